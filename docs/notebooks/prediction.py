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
from IPython.display import Image

# %% [markdown]
# ## What is missing
#
# `--quick` simulates fewer campaigns for the check. Leave it out for an answer to rely on.

# %% language="bash"
# skred diagnose ryggfonn --base-model coulomb --quick --quiet --out diagnosed

# %%
verdict = json.loads(Path("diagnosed/verdict.json").read_text(encoding="utf-8"))
print(verdict["verdict"], verdict["mechanism"], verdict["probability"][verdict["mechanism"]], sep="\n")

# %% [markdown]
# ## Predict
#
# The house is at s = 2000 m, the road at 2100 m: s is the length along the track from its first point. A pressure of 30 kPa is asked about, and
# avalanches like those recorded come 0.7 times a year, give or take 0.15: 22 in 32 years. Nothing is sampled again.

# %% language="bash"
# skred predict --from diagnosed --at house=2000 --at road=2100 --pressure 30 --per-year 0.7,0.15 --out predicted

# %% [markdown]
# ## The numbers
#
# `places.csv` has them as a table:

# %%
places = pd.read_csv("predicted/places.csv")
places

# %% alt="At the house and at the road: probability that the front speed and the impact pressure are exceeded"
Image("predicted/places.png")

# %% [markdown]
# How fast along the whole track:

# %% alt="Probability of front speeds along the track, and of runouts"
Image("predicted/prediction.png")

# %% [markdown]
# ## What it rests on
#
# The intervals hold if the law is right. These avalanches met a dam, which the track does not have: the force that was found may well be that dam, see [Ryggfonn](../ryggfonn.md).
# `predicted/report.html` is the page to attach, with everything that a prediction does not know.
