"""The columns of reports, by which type checkers find a misspelt name. A test compares them with the reports."""

from typing import TypedDict

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
Text = npt.NDArray[np.str_]


class Numbers(TypedDict):
    """The columns of numbers in a report of targets."""

    x_mm: Float
    y_mm: Float
    z_mm: Float
    error_x_mm: Float
    error_y_mm: Float
    error_z_mm: Float
    error_mm: Float
    error_rx_deg: Float
    error_ry_deg: Float
    error_rz_deg: Float
    error_normal_mm: Float
    correction_x_mm: Float
    correction_y_mm: Float
    correction_z_mm: Float
    correction_rx_deg: Float
    correction_ry_deg: Float
    correction_rz_deg: Float
    remaining_mm: Float
    fx_n: Float
    fy_n: Float
    fz_n: Float
    sigma_mm: Float
    depth_mm: Float
    engaged_deg: Float
    removed_mm3: Float
    remaining_path_mm: Float
    spin_deg: Float
    q1_deg: Float
    q2_deg: Float
    q3_deg: Float
    q4_deg: Float
    q5_deg: Float
    q6_deg: Float
    feed_mm_s: Float
    error_part_mm: Float


class Report(Numbers):
    """A report of targets, a row for each."""

    target: Whole
    line: Whole
    name: Text
    status: Text
    reason: Text
    tool: Text
    wobj: Text


class Residuals(TypedDict):
    """The residuals of an identification."""

    run: Whole
    line: Whole
    block: Whole
    held_out: Whole
    outlier: Whole
    x_mm: Float
    y_mm: Float
    z_mm: Float
    prefit_x_mm: Float
    prefit_y_mm: Float
    prefit_z_mm: Float
    postfit_x_mm: Float
    postfit_y_mm: Float
    postfit_z_mm: Float
    whitened_x: Float
    whitened_y: Float
    whitened_z: Float
    target: Whole


class Moved(TypedDict):
    """The targets that moved between two programs."""

    target: Whole
    line: Whole
    shift_x_mm: Float
    shift_y_mm: Float
    shift_z_mm: Float
    shift_mm: Float
    turn_deg: Float
    step_mm: Float
    # Numbers, all of them NaN, where no configuration changes: an empty column has no type of its own.
    conf_before: Text | Float
    conf_after: Text | Float


class DrivenPath(TypedDict):
    """The path that a controller drives."""

    time_s: Float
    target: Whole
    x_mm: Float
    y_mm: Float
    z_mm: Float
    qw: Float
    qx: Float
    qy: Float
    qz: Float
    feed_mm_s: Float
    fx_n: Float
    fy_n: Float
    fz_n: Float


class SurfacePoints(TypedDict):
    """Points of a cut surface."""

    x_mm: Float
    y_mm: Float
    z_mm: Float
    deviation_mm: Float
