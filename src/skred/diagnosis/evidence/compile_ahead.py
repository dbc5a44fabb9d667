"""Compilation of what a diagnosis needs beside the kernel, while another process compiles that."""

from __future__ import annotations

import numpy as np

from skred.diagnosis.evidence.marginal import evidence, importance_evidence
from skred.diagnosis.evidence.score_information import reading_slopes
from skred.inference.error_model import ErrorModel, EventReadings
from skred.inference.hierarchical.event_density import draw_nodes
from skred.inference.hierarchical.surface import Nodes
from skred.inference.reading_density import assess


def compile_ahead(readings: EventReadings, error_model: ErrorModel) -> None:
    """Call the compiled functions of a diagnosis once, on numbers made up, so that they are on disk.

    In the order in which they are needed, and none that runs a front: that is the largest, and compiled by
    whoever calibrates meanwhile. Where all is on disk this takes no time.
    """
    n_events, n_sensors = readings.values.shape
    events, errors = np.arange(n_events), error_model.errors
    predictions = np.ones((n_events, n_sensors + 1))
    assess(events, np.repeat(predictions[:, None], 4, axis=1), readings, errors, np.zeros((n_events, 5)))
    n_nodes = 8  # of each event: enough for a sum
    points = np.random.default_rng(0).normal(0.0, 0.3, (2, n_events * n_nodes))
    nodes = Nodes(n_nodes * np.arange(n_events + 1), points, np.zeros(points.shape[1]), np.empty(0))
    found = evidence(nodes, np.zeros(2), np.zeros(5), n_steps=1)
    importance_evidence(nodes, np.zeros(2), found)
    reading_slopes(events, predictions, readings, errors)
    draw_nodes(np.zeros((1, 2)), np.eye(2)[None], np.full((1, n_events), 0.5), *nodes[:3])
