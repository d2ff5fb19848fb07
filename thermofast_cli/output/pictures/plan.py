"""The picture of a plan: half-width against the time measured, one curve for each alternative."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .plots import MEASURED, new_figure, styled

if TYPE_CHECKING:
    from ...experiments.planning import Curve


@styled
def draw_plan(curves: Sequence["Curve"], tolerances_c: Sequence[float]) -> Any:
    """Both axes logarithmic; the tolerances as lines."""
    if not curves:
        return None
    figure = new_figure(8.0, 4.4)
    axis = figure.subplots()
    for i, curve in enumerate(curves):
        axis.loglog(curve.time, curve.half_width, label=curve.name, linewidth=2.4 if i == 0 else 1.3)
    for tolerance in tolerances_c:
        axis.axhline(tolerance, color=MEASURED, linestyle=":", linewidth=1.0)
    axis.set_xlabel("measured, min")
    axis.set_ylabel("half-width of the steady state's 95 % interval, K")
    axis.legend()
    return figure
