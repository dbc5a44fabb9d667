"""``skred validate``: check the files of a campaign.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import BAD_INPUT, DONE
from skred.cli.hints import hints_of
from skred.cli.options import Campaigns, Json, Quiet
from skred.cli.output import write_json


def validate(campaign: Campaigns, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """Check the files of a campaign and list every problem, and what is odd where there is none."""
    from skred.campaign import CampaignError, find_campaign, read_campaign

    try:
        checked = read_campaign(find_campaign(campaign))
    except CampaignError as error:
        if not as_json:
            raise
        write_json({"valid": False, "problems": [problem.as_dict() for problem in error.problems]})
        return BAD_INPUT
    from skred.campaign.summary import campaign_summary, summary_table

    hints = hints_of(checked)
    if as_json:
        warnings = [hint.as_dict() for hint in hints]
        write_json({"valid": True, "problems": [], "warnings": warnings, **campaign_summary(checked)})
    elif not quiet:
        from rich.console import Console
        from rich.text import Text

        console = Console()
        console.print(summary_table(campaign_summary(checked)))
        for hint in hints:
            console.print(Text(f"warning: {hint}"), soft_wrap=True)
    return DONE
