"""Build the embedded Ryggfonn campaigns from the raw figures: ``python -m studies.ryggfonn.build_campaigns``.

Rewrites the five campaign files of ``data/ryggfonn`` and ``data/ryggfonn-with-dam``; other files there stay.
"""

import argparse
from pathlib import Path

from skred.campaign import write_campaign
from studies.ryggfonn.campaigns import build

DATA = Path(__file__).resolve().parents[2] / "data"


def main() -> None:
    """Build both campaigns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--raw", type=Path, default=DATA / "ryggfonn" / "raw", help="folder of the raw figures"
    )
    parser.add_argument(
        "--out", type=Path, default=DATA, help="folder in which the two campaigns are written"
    )
    chosen = parser.parse_args()
    for with_dam in (False, True):
        campaign = build(chosen.raw, with_dam=with_dam)
        write_campaign(campaign, chosen.out / campaign.name, force=True)
        print(f"{campaign.name}: {campaign.fingerprint()}")


if __name__ == "__main__":
    main()
