"""Log density of the priors at every draw: what ArviZ's sensitivity checks weigh draws by."""

from __future__ import annotations

import pymc as pm
import xarray as xr
from pymc.stats import compute_log_prior

from skred.inference.sampling import quiet_pymc


def with_log_prior(tree: xr.DataTree, model: pm.Model) -> xr.DataTree:
    """The tree of a calibration with one more group, ``log_prior``: (chain, draw) for each parameter [nat].

    Parameters
    ----------
    tree : DataTree
        With a posterior.
    model : pymc.Model
        That of the posterior.
    """
    with quiet_pymc():
        density = compute_log_prior(
            xr.DataTree.from_dict({"posterior": tree["posterior"].to_dataset()}),
            model=model,
            extend_inferencedata=False,
            progressbar=False,
        )
    found = density if isinstance(density, xr.Dataset) else density.to_dataset()
    found = found.drop_attrs()
    for variable in found.data_vars.values():
        variable.attrs["units"] = "nat"
    return tree.assign({"log_prior": xr.DataTree(found)})
