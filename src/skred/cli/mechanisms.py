"""``skred mechanisms``: what a law may lack.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import DONE
from skred.cli.options import Json, MechanismIds, Quiet
from skred.cli.output import write_json
from skred.errors import InputError


def mechanisms(mechanism: MechanismIds = None, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """List the mechanisms that a law may lack, or show one of them in full."""
    from skred.physics.laws import law_ids, load_law
    from skred.physics.mechanisms import mechanisms as library
    from skred.report.mechanisms import mechanism_document, mechanism_table, mechanisms_table

    known = library()
    if mechanism is not None and mechanism not in known:
        raise InputError(f"no mechanism named {mechanism!r}; there are: {', '.join(sorted(known))}")
    laws = [load_law(law_id) for law_id in law_ids()]
    documents = [mechanism_document(known[name], laws) for name in sorted(known)]
    chosen = next((one for one in documents if one["id"] == mechanism), None)
    if as_json:
        write_json({"mechanisms": documents} if chosen is None else chosen)
    elif not quiet:
        from rich.console import Console

        n_laws = len(laws)
        table = mechanisms_table(documents, n_laws) if chosen is None else mechanism_table(chosen, n_laws)
        Console().print(table)
    return DONE
