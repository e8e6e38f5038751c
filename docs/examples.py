"""How Sphinx-Gallery runs the examples: their order, their style, their pictures."""

from pathlib import Path

import matplotlib.pyplot as plt
from sphinx_gallery.scrapers import figure_rst

from vehiclemor import registry
from vehiclemor.report.figures import theme

ORDER = (
    "reduce_a_suspension",
    "repeat_or_predict",
    "my_steering_log",
    "double_lane_change",
    "around_a_course",
    "predictive_control",
    "optimal_control",
    "thousand_maneuvers",
    "sampled_plans",
    "truck_on_a_road",
    "hard_points",
    "my_model",
    "my_method",
    "outside_method",
    "fmu",
    "cluster",
)


def in_order(name: str) -> int:
    """Key by which examples are sorted."""
    return ORDER.index(Path(name).stem)


def fresh(_: dict, __: str) -> None:
    """Each example begins with the style of the figures and finds plug-ins anew."""
    plt.style.use(theme.OWN_STYLE)
    registry._entries.cache_clear()


def picture(_: tuple, variables: dict, conf: dict) -> str:
    """Show the figure that `vm.plot` has returned: pyplot does not know it."""
    figure = variables["example_globals"].pop("figure", None)
    if figure is None or figure.canvas.manager is not None:
        return ""
    figure.savefig(path := next(variables["image_path_iterator"]), dpi=200)
    return figure_rst([path], conf["src_dir"])
