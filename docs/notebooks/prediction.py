# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Notebook: a prediction with the augmented law at a named place
#
# A diagnosis of the Coulomb model, dry friction alone, finds that something is missing at Ryggfonn. The prediction then takes the *augmented law*: the Coulomb model with what was
# added. It is asked about two made-up places below the dam, a house and a road. [Predictions](../predictions.md) has every option.

# %%
import json
from pathlib import Path

import pandas as pd
from IPython.display import Image, Markdown

# %% [markdown]
# ## What is missing
#
# `--quick` simulates fewer campaigns for the check. Leave it out for an answer to rely on.

# %% language="bash"
# skred diagnose ryggfonn --base-model coulomb --quick --quiet --out diagnosed

# %%
verdict = json.loads(Path("diagnosed/verdict.json").read_text(encoding="utf-8"))
Markdown(verdict["statement"])

# %% [markdown]
# ## Predict
#
# The house is at s = 2000 m, the road at 2100 m: s is the length along the track from its first point. A pressure of 30 kPa is asked about, and
# avalanches like those recorded come 0.7 times a year, give or take 0.15: 22 in 32 years. Nothing is sampled again.

# %% language="bash"
# skred predict --from diagnosed --at house=2000 --at road=2100 \
#   --pressure 30 --per-year 0.7,0.15 --out predicted

# %% [markdown]
# ## The numbers
#
# `places.csv` has them as a table. These are the rows of the house:

# %%
pd.set_option("display.max_colwidth", None)
places = pd.read_csv("predicted/places.csv", keep_default_na=False)
places[places["place"] == "house"].drop(columns=["place", "s [m]"]).round(2)

# %% alt="At the house and at the road: share of avalanches that exceed each front speed and each impact pressure, with 90 % bands"
Image("predicted/places.png")

# %% [markdown]
# How fast along the whole track:

# %% alt="Front speeds that half, a tenth and a hundredth of the avalanches exceed along the track, and the probability of running beyond each place, with what was recorded"
Image("predicted/prediction.png")

# %% [markdown]
# ## What it rests on
#
# The intervals hold if the law is right. All but one of these avalanches met a catching dam at s = 1940 m, which this track does not have: [Ryggfonn](../ryggfonn.md)
# says what the answers depend on.
# `predicted/report.html` is the page to attach, with everything that a prediction does not know.
