# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Notebook: ArviZ with the results
#
# Every result of skred is a tree in ArviZ's groups, so ArviZ's functions take it as it is. This page calibrates two laws on the 22 avalanches of
# Ryggfonn and looks at them with ArviZ: is a posterior sampled well, does it predict what was recorded, and which law predicts better?
# [From Python](../python.md#arviz) says what is in each group.

# %%
import arviz as az
import arviz_plots as azp

import skred

azp.style.use("arviz-variat")

# %% [markdown]
# Few draws, so that this page is made in a minute. For results leave `draws` out: there are 1000 then.

# %% tags=["parameters"]
DRAWS = 500

# %% [markdown]
# ## Two laws
#
# `pooled` means: one set of coefficients for the path.

# %%
coulomb = skred.calibrate("coulomb", draws=DRAWS, tune=500)
pcm = skred.calibrate("pcm", draws=DRAWS, tune=500)
pcm

# %%
az.summary(pcm.posterior, round_to=3)

# %% alt="Rank plots of both coefficients of the PCM model: four chains that wander around zero, with a p-value far above its limit"
_ = azp.plot_rank(pcm.posterior)

# %% [markdown]
# The chains agree where the p-values of their ranks are above α.
#
# ## What would be recorded?
#
# `posterior_predictive` has one variable for each sensor: what it would read of new avalanches. The black line is what was recorded.
# Speeds are in m/s, the runout in m.

# %% alt="For each sensor, recorded values and draws of what would be recorded"
_ = azp.plot_ppc_dist(pcm.posterior, num_samples=50)

# %% [markdown]
# PIT values say where in its predicted distribution each recorded value lies. If the predictions are right, they are uniform, and the curve stays
# near zero. Where p is below α, it does not.

# %% alt="PIT values of all four sensors beside those of a uniform distribution, each with its p-value"
_ = azp.plot_ppc_pit(pcm.posterior)

# %% [markdown]
# ## Leave-one-out
#
# An avalanche is left out as a whole, with all its readings: they share one front. ArviZ warns where one is too influential for importance
# sampling, with a Pareto k above 0.7.

# %%
loo = az.loo(pcm.posterior, pointwise=True)
loo

# %% alt="Pareto k of every avalanche, all far below 0.7"
_ = azp.plot_khat(loo)

# %% [markdown]
# The same PIT values with each avalanche left out, here of the sensor `b`:

# %% alt="PIT values of the sensor b with each avalanche left out, beside a uniform distribution"
_ = azp.plot_loo_pit(pcm.posterior, var_names="b")

# %% [markdown]
# ## Which law predicts better?

# %%
table = az.compare({"pcm": pcm.posterior, "coulomb": coulomb.posterior})
table

# %% alt="Expected log predictive density of both laws with standard errors"
_ = azp.plot_compare(table)

# %% [markdown]
# `skred compare` does this and more: it refits where importance sampling is unreliable, computes the evidence, and says in sentences
# what the difference rests on. [Laws and likelihoods](../laws-and-likelihoods.md) says why the likelihood is what it is.
