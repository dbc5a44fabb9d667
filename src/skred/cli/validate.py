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
    from dataclasses import asdict

    from skred.campaign.summary import campaign_summary, summary_table
    from skred.physics.terrain import build_terrain
    from skred.physics.terrain_hints import campaign_places, smoothing_cost

    terrain = build_terrain(checked.track.x_m, checked.track.z_m)
    hints = hints_of(checked, terrain)
    cost = asdict(smoothing_cost(checked.track, terrain, campaign_places(checked)))
    summary = campaign_summary(checked) | {"smoothing": cost}
    if as_json:
        write_json({"valid": True, "problems": [], "warnings": [hint.as_dict() for hint in hints], **summary})
    elif not quiet:
        from rich.console import Console
        from rich.text import Text

        console = Console()
        console.print(summary_table(summary, len(hints)))
        for hint in hints:
            console.print(Text(f"warning: {hint}"), soft_wrap=True)
    return DONE
