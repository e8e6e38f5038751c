"""Cars seen moving, full order and reduced together, as a GIF: lines in space."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.spatial.transform import Rotation

from vehiclemor.arguments import file_path, number, quoted, within
from vehiclemor.exceptions import InputError
from vehiclemor.files import begins_with, replaceable, write_whole
from vehiclemor.parameters import load_parameters
from vehiclemor.registry import component
from vehiclemor.report.figures.result_plot import by_method
from vehiclemor.report.figures.runs import configuration, model_name
from vehiclemor.report.figures.theme import FULL, Style, panels, styled, styles
from vehiclemor.report.labels import method_text
from vehiclemor.simulation.trajectory import Trajectory

FRAMES_PER_SECOND, DURATIONS, FACTORS = 12, (0.5, 60.0), (0.01, 1000.0)
# Half of what is seen of the road from above; and least and most of it from behind (m).
ALONG, ACROSS, NARROWEST, WIDEST = 16.0, 7.0, 3.0, 6.5
PLACE = ("longitudinal_position", "lateral_position", "yaw")
NEEDED = (*PLACE, "pitch", "roll")
# ISO 8855.
AXES = "X, forward (m)", "Y, left (m)", "Z, up (m)"
# Histories (frames,) and parameters by name.
Values = Mapping[str, Any]
# For the drawing only: sizes of a car whose parameters have other names, and of its body (m).
CAR = {"front_axle_distance": 1.2, "rear_axle_distance": 1.4, "front_track": 1.5}
CAR |= {"tire_radius": 0.32, "tire_stiffness": 2e5}
SECTION = ((-0.8, 0.3), (0.8, 0.3), (0.8, 0.8), (0.6, 1.4), (-0.6, 1.4), (-0.8, 0.8), (-0.8, 0.3))
OVERHANG, RIM = 0.8, 0.1


def line(*points: Sequence[Any] | np.ndarray) -> np.ndarray:
    """Lines (frames, points, 3) through points, whose coordinates are numbers or (frames,)."""
    columns = np.broadcast_arrays(*(np.atleast_1d(c) for point in points for c in point))
    return np.stack(columns, -1).reshape(len(columns[0]), -1, 3)


def turned(lines: np.ndarray, axes: str, *angles: Any) -> np.ndarray:
    """Lines turned about axes by angles (frames,) in rad."""
    by = np.stack(np.broadcast_arrays(*(np.atleast_1d(angle) for angle in angles)), -1)
    return lines @ Rotation.from_euler(axes, by).as_matrix().swapaxes(1, 2)


def chained(*pieces: np.ndarray) -> np.ndarray:
    """One line of several."""
    frames = max(len(piece) for piece in pieces)
    return np.concatenate([np.broadcast_to(p, (frames, *p.shape[1:])) for p in pieces], 1)


def joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """All lines as one, with gaps between them."""
    gap = np.full((1, 1, 3), np.nan)
    return chained(*(piece for part in parts for piece in (part, gap)))


def wheel(radius: float) -> np.ndarray:
    """Both rims of a wheel about the y axis, and four lines across its tread."""
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    x, z = radius * np.cos(angle), radius * np.sin(angle)
    rims = [line(*np.stack([x, 0.0 * x + y, z], -1)) for y in (-RIM, RIM)]
    across = [line((x[k], -RIM, z[k]), (x[k], RIM, z[k])) for k in (0, 10, 20, 30)]
    return joined([*rims, *across])


def car(h: Values, p: Values, magnify: float) -> np.ndarray:
    """Body, wheels on the road, and springs between them."""
    p = CAR | {name: p[name] for name in CAR if name in p}
    still, radius = 0.0 * h["yaw"], p["tire_radius"]
    height = h.get("Z", h.get("z", still))
    front, rear = p["front_axle_distance"], -p["rear_axle_distance"]
    corners = [(x, *c) for x in (front + OVERHANG, rear - OVERHANG) for c in SECTION]
    body = turned(line(*corners), "YX", magnify * h["pitch"], magnify * h["roll"])
    body = body + line((0.0, 0.0, magnify * (height - height[0])))
    # The right sill closes what is seen from above.
    parts = [body, body[:, [1, 8]]]
    for x, axle, first in ((front, "F", 0), (rear, "R", 7)):
        for side, sign, corner in (("L", 0.5, 2), ("R", -0.5, 5)):
            steer = h.get(f"steer_{axle}{side}", h.get("delta", still)) if axle == "F" else still
            load = h.get(f"Fz_{axle}{side}", still)
            rise = magnify * (load[0] - load) / p["tire_stiffness"]
            hub = line((x, sign * p["front_track"], radius + rise))
            parts += [hub + turned(wheel(radius), "Z", steer)]
            parts += [chained(hub, body[:, [first + corner]])]
    position = line((h["longitudinal_position"], h["lateral_position"], 0.0))
    return turned(joined(parts), "Z", h["yaw"]) + position


def animate(
    run: Trajectory | xr.Dataset,
    *beside: Trajectory | xr.Dataset,
    labels: Sequence[str] = (),
    duration: float = 8.0,
    magnify: float = 3.0,
    out: str | Path = "car.gif",
) -> Path:
    """Write a film of runs of a car with the same input, together in colours.

    Parameters
    ----------
    run
        A run, or a dataset of `vehiclemor.simulate`, which holds its full order too.
    *beside
        Further runs, the full order last: it is grey, and the view follows it.
    labels
        Text of each run.
    duration
        Of the film in s; the run is shown faster or slower.
    magnify
        Factor on roll, pitch and bounce, which the title names.
    out
        GIF file.

    Raises
    ------
    InputError
        If the runs are of several inputs, or lack outputs that the drawing of a car needs.
    """
    path = file_path("out", out)
    if path.suffix.lower() != ".gif":
        raise InputError(f"out is {quoted(str(path))}; a film ends with .gif")
    replaceable(path, "film as GIF", begins_with(b"GIF8"))
    seconds = within("duration", number("duration", duration), DURATIONS, " s")
    methods: list[str] = []
    runs: list[dict[str, np.ndarray]] = []
    for each in (run, *beside):
        for method, quantities in _histories(each):
            methods.append(method)
            runs.append(quantities)
    texts = list(labels) or [method_text(name) for name in methods]
    if not labels and beside:
        texts[-1] = "full order"
    if len(texts) != len(runs):
        raise InputError(f"labels: {len(runs)} runs are drawn, not {len(texts)}")
    followed = runs[-1]
    lacking = [name for name in NEEDED if any(name not in h for h in runs)]
    if lacking:
        raise InputError(f"no film of these runs: to draw a car it lacks {', '.join(lacking)}")
    if not all(np.array_equal(followed["time"], h["time"]) for h in runs):
        raise InputError("the runs have several times; a film shows runs of one input")
    factor = within("magnify", number("magnify", magnify), FACTORS)
    finite = np.flatnonzero(np.isfinite([followed[name] for name in NEEDED]).all(0))
    if not len(finite):
        raise InputError("the last run has no finite values; the view follows it")
    count = max(2, round(FRAMES_PER_SECOND * seconds))
    rows = np.linspace(finite[0], finite[-1], count).round().astype(int)
    with styled():
        looks = _styles(methods)
        frames = [{name: h[name][rows] for name in h} for h in runs]
        film = _film(frames, texts, looks, _parameters(run), factor)
        writer = PillowWriter(fps=FRAMES_PER_SECOND)
        return write_whole(path, lambda part: film.save(part, writer=writer, dpi=100))


def _styles(methods: Sequence[str]) -> list[Style]:
    """Style of each run: the colour of its method, the last one of several in grey."""
    numbered = {str(k): method for k, method in enumerate(methods)}
    solid: Style = {"linestyle": "-", "linewidth": 1.2}
    looks = [look | solid for look in styles(numbered, numbered).values()]
    if len(looks) > 1:
        looks[-1] = FULL | {"zorder": 1.5, "linewidth": 3.5}
    return looks


def _film(
    runs: list[Any], names: Sequence[str], looks: Sequence[Style], parameters: Values, factor: float
) -> FuncAnimation:
    """Two views, in each of them a line a run that moves, and from above its path so far."""
    followed = runs[-1]
    times = followed["time"]
    position, yaw = line((*(followed[name] for name in PLACE[:2]), 0.0)), followed["yaw"]
    figure, grid = panels(2, 1, (5.6, 4.4))
    FigureCanvasAgg(figure)
    above, back = grid.ravel()
    views = [(above, "from above", [0, 1]), (back, "from behind", [1, 2])]
    spaces = [car(h, parameters, factor) for h in runs]
    moving, paths = [], []
    for axis, title, columns in views:
        relative = [turned(s - position, "Z", -yaw) for s in spaces] if axis is back else spaces
        shown = [space[..., columns] for space in relative]
        for lines, look, name in zip(shown, looks, names, strict=True):
            moving.append((axis.plot(*lines[0].T, **look, label=name)[0], lines))
        every = np.concatenate([lines.reshape(-1, 2) for lines in shown])
        low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
        edge = 0.05 * (high - low).max()
        reach = np.clip(abs(every[:, 0]), NARROWEST, WIDEST)
        low[0], high[0] = -np.nanmax(reach), np.nanmax(reach)
        across, up = (AXES[column] for column in columns)
        axis.set(aspect="equal", title=title, xlabel=across, ylabel=up)
        axis.set(xlim=(low[0] - edge, high[0] + edge), ylim=(low[1] - edge, high[1] + edge))
    # The left side of a car stands at the left of who drives behind it.
    back.invert_xaxis()
    if factor != 1.0:
        back.set_title(f"from behind, motion x {factor:g}")
    for h, look in zip(runs, looks, strict=True):
        (path,) = above.plot([], [], **look | {"linewidth": 0.6})
        paths.append((path, np.stack([h[name] for name in PLACE[:2]])))

    def show(frame: int) -> None:
        for curve, lines in moving:
            curve.set_data(*lines[frame].T)
        for path, driven in paths:
            path.set_data(*driven[:, : frame + 1])
        figure.suptitle(f"t = {times[frame]:.1f} s")
        x, y, _ = position[frame, 0]
        above.set(xlim=(x - ALONG, x + ALONG), ylim=(y - ACROSS, y + ACROSS))

    show(0)
    handles = [curve for curve, _ in moving if curve.axes is above]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    figure.draw_without_rendering()
    # The panels stay where they are while the numbers beside them change.
    figure.set_layout_engine("none")
    return FuncAnimation(figure, show, frames=len(times), repeat=False)


def _histories(run: Any) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Method and quantities (samples,) of a run; of a dataset each one's, the full order last."""
    dataset = run.dataset() if isinstance(run, Trajectory) else run
    if not isinstance(dataset, xr.Dataset) or "outputs" not in dataset:
        raise InputError(f"{quoted(run)} is neither a run nor a dataset with histories")
    dataset = by_method(dataset)
    known = [str(label) for label in dataset["label"].values]
    reduced = [label for label in known if not label.startswith("full_order")] or known[:1]
    histories = [(name, _quantities(dataset.sel(label=name), "outputs")) for name in reduced]
    if "reference_outputs" in dataset and not reduced[0].startswith("full_order"):
        full = _quantities(dataset.isel(label=0), "reference_outputs")
        histories.append(("full_order", full))
    return histories


def _quantities(dataset: xr.Dataset, outputs: str) -> dict[str, np.ndarray]:
    """Histories (samples,) by name; of the full order in a dataset no coordinates are stored."""
    quantities = {"time": dataset["time"].values}
    kinds = {"inputs": "input", "coordinates": "coordinate", outputs: "output"}
    for variable, kind in kinds.items():
        if variable in dataset and (kind != "coordinate" or outputs == "outputs"):
            columns = dataset[variable].transpose(kind, "time").values
            quantities |= zip(map(str, dataset[kind].values), columns, strict=True)
    return quantities


def _parameters(run: Any) -> dict[str, Any]:
    """Parameters by name: those of a run, or of its model's file with what a dataset tells."""
    if isinstance(run, Trajectory):
        return run.model.parameters.values()
    model = component("model", model_name(run))
    known = load_parameters(model.name, model.parameters, model.parameter_file).values()
    changed = configuration(run).get("parameters", {})
    return known | {name: np.array(value) for name, value in changed.items()}
