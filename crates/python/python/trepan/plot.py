"""Plots of recordings with matplotlib (needs matplotlib)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .recordings import Recording


def plot_recording(recording: Recording) -> Figure:
    """Forces, depths and bone removed over time, three axes under each other; no window opens.

    Save it with ``figure.savefig("session.png")``; a notebook shows it by itself.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as fault:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from fault

    ticks = recording.ticks
    time_s = 1e-3 * ticks["time_ms"]
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    force, depth, bone = figure.subplots(3, 1, sharex=True)
    force.plot(time_s, np.linalg.norm(ticks["force_n"], axis=1), lw=0.8, label="on the hand")
    force.plot(time_s, ticks["tissue_n"], lw=0.8, label="of tissue")
    force.set_ylabel("force, N")
    depth.plot(time_s, ticks["depth_mm"], lw=0.8, label="in bone")
    depth.plot(time_s, ticks["tissue_depth_mm"], lw=0.8, label="in tissue")
    depth.set_ylabel("depth, mm")
    bone.plot(time_s, np.cumsum(ticks["removed_mm3"]), color="tab:brown", label="bone removed")
    bone.set(ylabel="volume, mm$^3$", xlabel="time, s")
    for event in recording.events:
        if event.kind in ("phase", "warning"):
            colour = "tab:red" if event.kind == "warning" else "0.6"
            for axes in (force, depth, bone):
                axes.axvline(1e-3 * event.time_ms, color=colour, lw=0.6, ls=":")
    for axes in (force, depth, bone):
        axes.legend(loc="upper left", fontsize="small")
    force.set_title(f"{recording.app}, case {recording.case}")
    return figure
