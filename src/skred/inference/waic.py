"""WAIC from a pointwise log likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.special import logsumexp

UNRELIABLE_VARIANCE = 0.4
"""Above this posterior variance of an event's log likelihood WAIC is not to be trusted."""


@dataclass(frozen=True, eq=False)
class Waic:
    """Widely applicable information criterion on the scale of the log score.

    Attributes
    ----------
    elpd_waic : float
        Expected log predictive density, lppd - p_waic; WAIC on the deviance scale is -2 times this.
    se : float
        Standard error over events, sqrt(n var(pointwise)); optimistic for few events.
    p_waic : float
        Effective number of parameters.
    lppd : float
        Log predictive density of the recordings themselves.
    pointwise : DataArray
        elpd_waic of each event.
    p_waic_pointwise : DataArray
        Posterior variance of each event's log likelihood.
    n_draws : int
        Posterior draws over all chains.
    n_unreliable : int
        Number of events whose variance exceeds 0.4.
    """

    elpd_waic: float
    se: float
    p_waic: float
    lppd: float
    pointwise: xr.DataArray
    p_waic_pointwise: xr.DataArray
    n_draws: int
    n_unreliable: int

    @property
    def unreliable(self) -> bool:
        """Whether any event's variance exceeds 0.4: use leave-one-out instead."""
        return self.n_unreliable > 0


def waic(posterior: xr.DataArray | xr.DataTree, *, variable: str | None = None) -> Waic:
    """Compute WAIC over events.

    Parameters
    ----------
    posterior : DataArray or DataTree
        Pointwise log likelihood with dims chain, draw and one more (the event), or a tree that
        holds it in the group ``log_likelihood``.
    variable : str, optional
        Its name in that group; needed only where there are several.

    Returns
    -------
    Waic

    Raises
    ------
    ValueError
        If the log likelihood is absent, ambiguous, has other dims or is not finite.

    References
    ----------
    Watanabe (2010), Journal of Machine Learning Research 11, 3571-3594. Variance form (p_WAIC2) and
    eight-schools example: Gelman, Hwang and Vehtari (2014), doi:10.1007/s11222-013-9416-2. Limit of
    0.4: Vehtari, Gelman and Gabry (2017), doi:10.1007/s11222-016-9696-4.
    """
    log_likelihood = _pointwise_log_likelihood(posterior, variable)
    sample = ("chain", "draw")
    n_draws = log_likelihood.sizes["chain"] * log_likelihood.sizes["draw"]
    if n_draws < 2:
        raise ValueError(f"WAIC needs at least two draws, found {n_draws}")
    lppd = log_likelihood.reduce(logsumexp, dim=sample) - np.log(n_draws)
    variance = log_likelihood.var(dim=sample, ddof=1)
    pointwise = (lppd - variance).rename("elpd_waic")
    return Waic(
        elpd_waic=float(pointwise.sum()),
        se=float(np.sqrt(pointwise.size * pointwise.var())),
        p_waic=float(variance.sum()),
        lppd=float(lppd.sum()),
        pointwise=pointwise,
        p_waic_pointwise=variance.rename("p_waic"),
        n_draws=n_draws,
        n_unreliable=int((variance > UNRELIABLE_VARIANCE).sum()),
    )


def _pointwise_log_likelihood(posterior: xr.DataArray | xr.DataTree, variable: str | None) -> xr.DataArray:
    if isinstance(posterior, xr.DataArray):
        array = posterior
    else:
        if "log_likelihood" not in posterior.children:
            raise ValueError("no group log_likelihood; compute it after sampling, then ask for WAIC")
        group = posterior["log_likelihood"].to_dataset()
        names = [str(name) for name in group.data_vars]
        name = variable if variable is not None or len(names) != 1 else names[0]
        if name not in names:
            raise ValueError(f"name one log likelihood variable of {names}, found {variable!r}")
        array = group[name]
    if not ({"chain", "draw"} <= set(array.dims) and array.ndim == 3):
        raise ValueError(f"expected dims chain, draw and one for events, found {array.dims}")
    event = next(str(dim) for dim in array.dims if dim not in ("chain", "draw"))
    values = array.transpose("chain", "draw", event).to_numpy()
    bad = np.flatnonzero(~np.isfinite(values).all(axis=(0, 1)))
    if len(bad):
        raise ValueError(f"log likelihood is not finite for {event} number {bad.tolist()}")
    return array
