"""``skred mechanisms``: what a law may lack.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from dataclasses import asdict

from skred.cli.exit_codes import DONE
from skred.cli.options import Json, MechanismIds, Quiet
from skred.cli.output import write_json
from skred.cli.refused import tell_refused
from skred.errors import InputError


def mechanisms(mechanism: MechanismIds = None, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """List the mechanisms that a law may lack, or show one of them in full."""
    from skred.physics.laws import installed_laws
    from skred.physics.mechanisms import library
    from skred.report.mechanisms import mechanism_document, mechanism_table, mechanisms_table

    known, unusable = library().mechanisms, library().refused
    if mechanism is not None and mechanism not in known:
        for one in unusable:
            if one.id == mechanism:
                raise InputError(str(one))
        raise InputError(f"no mechanism named {mechanism!r}; there are: {', '.join(sorted(known))}")
    laws, unusable_laws = installed_laws()
    tell_refused(*unusable, *unusable_laws)
    documents = [mechanism_document(known[name], laws) for name in sorted(known)]
    chosen = next((one for one in documents if one["id"] == mechanism), None)
    if as_json:
        refused = [asdict(one) for one in (*unusable, *unusable_laws)]
        write_json({"mechanisms": documents, "refused": refused} if chosen is None else chosen)
    elif not quiet:
        from rich.console import Console

        n_laws = len(laws)
        table = mechanisms_table(documents, n_laws) if chosen is None else mechanism_table(chosen, n_laws)
        Console().print(table)
    return DONE
