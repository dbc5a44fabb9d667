# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Notebook: from a spreadsheet to a verdict
#
# The table of 22 avalanches at Ryggfonn in Norway, as somebody would keep it in a German Excel: semicolons, decimal commas, dashes and blanks.
# It becomes a campaign, and the campaign a verdict. [Your own data](../own-data.md) explains each step for the command line,
# and what else a table may look like.
#
# Cells that begin with `skred` are commands of the shell, the others are Python.

# %%
from pathlib import Path

import skred

# %% [markdown]
# ## The table
#
# A row for each avalanche. `LC`, `CD` and `b` are sensors of front speed. `Auslauf ab Krone` says how far beyond the crown of the
# catching dam the avalanche stopped, and `±` how well that is known, as a standard deviation. A dash in a speed says that the avalanche stopped above the sensor.

# %%
TABLE = """\
Datum;LC [m/s];CD [m/s];b [m/s];Auslauf ab Krone [m];± [m]
25.02.1975;50,0;35,0;22,0;200;23,3
31.10.1983;;;;0;12,0
02.03.1984;30,0;22,0;0,0;-20;12,2
13.02.1985;34,0;26,0;17,0;70;13,9
28.01.1987;48,0;44,0;40,0;225;25,5
15.03.1988;20,0;1,0;-;-120;17,0
11.04.1988;38,0;33,0;27,0;45;12,8
17.02.1989;22,0;1,0;-;-100;15,6
03.04.1989;22,0;13,0;-;-30;12,4
11.03.1992;0,0;-;-;-326;34,7
27.03.1993;43,0;38,0;33,0;150;19,2
18.03.1994;31,0;28,0;25,0;80;14,4
03.03.1995;35,0;32,0;28,0;80;14,4
08.02.1997;45,0;43,0;40,0;195;22,9
17.04.1997;34,0;3,0;0,0;0;12,0
22.01.1999;20,0;12,0;3,0;0;12,0
17.02.2000;50,0;38,0;30,0;333;35,4
06.04.2003;15,0;0,0;-;-150;19,2
24.02.2004;32,0;28,0;22,0;111;16,3
28.02.2004;38,0;22,0;15,0;-10;12,0
16.04.2005;33,0;6,0;-;-50;13,0
22.03.2007;35,0;15,0;0,0;0;12,0
"""
_ = Path("avalanches.csv").write_text(TABLE, encoding="utf-8")

# %% [markdown]
# The track is a profile of the path: horizontal distance and elevation. Here it is the one of the included campaign.

# %%
track = skred.read_campaign("ryggfonn").track
points = [f"{x},{z}" for x, z in zip(track.x_m, track.z_m, strict=True)]
_ = Path("profile.csv").write_text("\n".join(["x_m,z_m", *points]) + "\n")
print(len(points), "points, from", track.z_m[0], "to", track.z_m[-1], "m above sea level")

# %% [markdown]
# ## Ask what is understood
#
# Without `--out` nothing is written. What the table leaves open is listed, with the words that answer it:

# %% language="bash"
# skred import avalanches.csv --track profile.csv || true  # it ends with an error, on purpose

# %% [markdown]
# ## Import
#
# The places of the sensors are arc lengths, along the track from its first point. Runouts count from the dam's crown at 1940 m, downhill positive.
# Speeds are good to 10 % and 1 m/s, and a runout without a standard deviation of its own to 12 m. No release was recorded, so all avalanches start at the top.

# %% language="bash"
# skred import avalanches.csv --track profile.csv \
#   --column "Datum=event" \
#   --column "LC [m/s]=front_velocity at=1650 unit=m/s" \
#   --column "CD [m/s]=front_velocity at=1810 unit=m/s" \
#   --column "b [m/s]=front_velocity at=1910 unit=m/s" \
#   --column "Auslauf ab Krone [m]=runout place=reference sensor=runout" \
#   --column "± [m]=sd of=runout" \
#   --reference 1940 \
#   --set velocity.relative_sd=0.1 --set velocity.absolute_sd=1 --set runout.absolute_sd=12 \
#   --set release.s_m=0 \
#   --blank missing --dash not_reached --yes --out my-campaign

# %% [markdown]
# `import.toml` in the folder keeps these answers: `skred import next-winter.csv --mapping my-campaign/import.toml --out DIR` asks nothing.
#
# ## Check
#
# Every problem would be listed with file, row and column:

# %% language="bash"
# skred validate my-campaign

# %% [markdown]
# ## What can these recordings tell at all?
#
# Before the diagnosis looks for missing physics in the Coulomb model, dry friction alone: how strong would each mechanism have to be to be seen?

# %% language="bash"
# skred identify my-campaign --base-model coulomb

# %% [markdown]
# ## The verdict
#
# `quick` simulates fewer campaigns for the check and adds one mechanism at most. For an answer to rely on, leave it out.

# %%
result = skred.diagnose("coulomb", "my-campaign", quick=True)
result

# %% [markdown]
# The verdict in one word, and each candidate with its probability:

# %%
print(result.document["verdict"])
for name, probability in sorted(result.document["probability"].items(), key=lambda one: -one[1])[:6]:
    print(f"{probability:6.2f}  {name}")

# %% [markdown]
# `report` writes the folder that `skred diagnose` would have written. Open its `report.html` in a browser.

# %%
page = result.report("diagnosed")
print(*sorted(file.name for file in page.parent.glob("[a-z]*")), sep="\n")

# %% [markdown]
# ## Read on
#
# [Reading a verdict](../reading-a-verdict.md) says what each part means. [Reliability](../reliability.md) says how often such answers are right.
# [Ryggfonn](../ryggfonn.md) has what the full diagnosis finds here. [Another notebook](prediction.py) predicts with the law that was found.
