"""The 3-D page: ``jf.show_frames_3d`` serves it with viser, the handle plays, records and closes it (the extra ``view``)."""

import math
import threading
import webbrowser
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Self

import numpy as np

from jaxframes.errors import FrameError
from jaxframes.model.state import State
from jaxframes.tree import FrameTree
from jaxframes.view.at_exit import close_with_program
from jaxframes.view.distances import Range, Scaling, default_range, logarithmic, ranges_of
from jaxframes.view.graph_data import Instants, States, instants_of, numbers_of
from jaxframes.view.looks import LabelMap, labels_of, one_instant, parents_of
from jaxframes.view.meshes import shapes_of
from jaxframes.view.options_3d import bodies_of, frames_of, reach_of, require_viser
from jaxframes.view.poses import Poses, poses_from
from jaxframes.view.scene import Contents, Scene, ways_of

PORT = 29624
MOST_SLIDERS = 60
DISTANCES = ("true", "logarithmic")


class Frames3D:
    """A 3-D page of a tree; ``jf.show_frames_3d`` makes one. Its methods may be called from any thread.

    Attributes:
        url: Where the page is.
        port: The port that it listens at.
    """

    def __init__(self, tree: FrameTree, state: State, instants: Instants | None, focus: int, distances: str, contents: Contents):
        self._tree, self._state, self._instants, self._focus, self._contents = tree, state, instants, focus, contents
        self._lock = threading.RLock()
        self._step, self._distances = 0, distances
        self._known: dict[int, tuple[list[int], np.ndarray]] = {}
        self._ways: tuple[int, np.ndarray] | None = None
        self._playing, self._closed = threading.Event(), threading.Event()
        self._labels = contents.labels

    def _serve(self, host: str, port: int, title: str, launch_client: bool) -> None:
        from jaxframes.view import guarded_viser

        self._server = guarded_viser.start(host, port, title)
        self.port = self._server.get_port()
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"
        self._server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="medium")
        self._scene = Scene(self._server.scene, self._contents, len(self._tree.names))
        self._add_controls()
        self.show()
        self._aim()
        player = threading.Thread(target=self._play, name="jaxframes 3-D player", daemon=True)
        player.start()
        close_with_program(self, player)
        if launch_client:
            webbrowser.open(self.url)

    # --- what is shown ------------------------------------------------------------------------------------------------------

    def show(self, step: int | None = None) -> None:
        """Show one of the instants, by its place among them. Default: the present one, anew."""
        with self._lock:
            if self._closed.is_set():
                raise FrameError(f"the page at {self.url} is closed; jf.show_frames_3d opens another")
            if step is not None:
                if not 0 <= step < self._steps:
                    raise FrameError(f"instant {step} is asked for, and there are {self._steps}")
                self._step = step
            parents, poses = self._poses(self._step)
            with self._server.atomic():
                self._scene.show(parents, poses, self._scaling(poses), self._trails())

    def update(self, state: State) -> None:
        """Show another state, one instant (FrameError where the page has a slider over time)."""
        if self._instants is not None:
            raise FrameError("this page shows the instants that it was given; show(step) goes to one of them")
        with self._lock:
            self._state = one_instant(self._tree, state)
            self._known.clear()
            self._ways = None
            self.show()

    @property
    def _steps(self) -> int:
        return 1 if self._instants is None else len(self._instants)

    def _numbers(self, step: int) -> tuple[list[int], np.ndarray]:
        """Return what hangs on what at an instant, and the numbers; worked out once."""
        if step not in self._known:
            state = self._state if self._instants is None else self._instants.state(step)
            self._known[step] = parents_of(self._tree, state)[0], numbers_of(self._tree, state)
        return self._known[step]

    def _poses(self, step: int) -> tuple[list[int], Poses]:
        parents, numbers = self._numbers(step)
        return parents, poses_from(parents, numbers, self._focus)

    def _trails(self) -> np.ndarray:
        """Return the ways of the frames with trails in the focus."""
        if self._ways is None or self._ways[0] != self._focus:
            steps = range(self._steps) if self._contents.trails else ()
            self._ways = self._focus, ways_of([self._poses(step)[1] for step in steps], self._contents.trails)
        return self._ways[1]

    def _ranges(self) -> list[Range]:
        return ranges_of(self._poses(self._step)[1][1], self._labels)

    def _scaling(self, poses: Poses) -> Scaling:
        if self._distances == DISTANCES[1]:
            return logarithmic(poses[1])
        return Scaling(self._metres)

    def _aim(self) -> None:
        """Let the camera of a new reader see all that lies within the range, trails too."""
        places, shown = self._scaling(self._poses(0)[1]).places(self._poses(0)[1][1])
        ways = self._scaling(self._poses(0)[1]).places(self._trails().reshape(-1, 3))[0]
        points = np.concatenate([places[shown], ways])
        low, high = points.min(0), points.max(0)
        middle, size = (low + high) / 2, max(float(np.linalg.norm(high - low)), 0.2)
        self._server.initial_camera.look_at = tuple(middle.tolist())
        self._server.initial_camera.position = tuple((middle + size * np.array([0.75, 0.65, 0.7])).tolist())

    # --- controls -----------------------------------------------------------------------------------------------------------

    def _add_controls(self) -> None:
        gui = self._server.gui
        if self._instants is not None:
            with gui.add_folder("Time"):
                when = gui.add_text("Instant", self._instants.labels[0], disabled=True)
                slider = gui.add_slider("Step", 0, max(1, self._steps - 1), 1, 0)
                play = gui.add_button("Play")
            self._slider, self._play_button = slider, play

            @slider.on_update
            def _(_: Any) -> None:
                step = min(int(slider.value), self._steps - 1)
                assert self._instants is not None
                when.value = self._instants.labels[step]
                self._guarded_show(step)

            @play.on_click
            def _(_: Any) -> None:
                on = not self._playing.is_set()
                (self._playing.set if on else self._playing.clear)()
                play.label = "Pause" if on else "Play"

        self._add_view_controls(gui)
        if self._instants is None:
            self._add_joints(gui)

    def _guarded_show(self, step: int | None = None) -> None:
        if not self._closed.is_set():
            self.show(step)

    def _add_view_controls(self, gui: Any) -> None:
        with gui.add_folder("View"):
            ranges = self._ranges()
            chosen = default_range(ranges)
            self._metres = chosen.metres
            self._reach = {one.text: one.metres for one in ranges}
            focus = gui.add_dropdown("Focus", self._unique, initial_value=self._unique[self._focus])
            reach = gui.add_dropdown("Range", tuple(self._reach), initial_value=chosen.text)
            distances = gui.add_dropdown("Distances", DISTANCES, initial_value=self._distances)
            labels = gui.add_checkbox("Labels", True)
            opacity = gui.add_slider("Meshes", 0.0, 1.0, 0.05, self._scene.opacity) if self._contents.shapes else None

        @focus.on_update
        def _(_: Any) -> None:
            with self._lock:
                self._focus = self._unique.index(focus.value)
                ranges = self._ranges()
                self._reach = {one.text: one.metres for one in ranges}
                self._metres = default_range(ranges).metres
                reach.options = tuple(self._reach)
                reach.value = default_range(ranges).text
            self._guarded_show()

        @reach.on_update
        def _(_: Any) -> None:
            with self._lock:
                self._metres = self._reach.get(reach.value, self._metres)
            self._guarded_show()

        @distances.on_update
        def _(_: Any) -> None:
            self._distances = distances.value
            self._guarded_show()

        @labels.on_update
        def _(_: Any) -> None:
            self._scene.with_labels = labels.value
            self._guarded_show()

        if opacity is not None:
            opacity.on_update(lambda _: self._scene.set_opacity(opacity.value))

    @property
    def _unique(self) -> tuple[str, ...]:
        """What frames are called in the list of focuses, each once."""
        labels = list(self._labels)
        return tuple(label if labels.count(label) == 1 else f"{label} (#{i})" for i, label in enumerate(labels))

    def _add_joints(self, gui: Any) -> None:
        """Add a slider for each joint with one coordinate, which starts where the state has it."""
        topology, q = self._tree.topology, np.asarray(self._state.q, float)
        with gui.add_folder("Joints", expand_by_default=len(topology.joint_names) <= 12):
            shown = 0
            for joint, frame in zip(topology.joint_names, topology.joint_frames, strict=True):
                first, count = topology.coordinates[frame][:2]
                if count == 1 and shown < MOST_SLIDERS:
                    shown += 1
                    self._add_joint(gui, joint, frame, first, float(q[first]))

    def _add_joint(self, gui: Any, joint: str, frame: int, column: int, value: float) -> None:
        low, high = reach_of(self._tree.edge_of(frame), value)
        slider = gui.add_slider(joint, low, high, (high - low) / 1000, value)

        @slider.on_update
        def _(_: Any) -> None:
            with self._lock:
                q = np.array(self._state.q)
                q[column] = slider.value
                self.update(self._state.replace(q=q))

    def _play(self) -> None:
        """Go on by a step, 20 times a second, while the page plays."""
        while not self._closed.wait(0.05):
            if self._playing.is_set():
                self._slider.value = (int(self._slider.value) + 1) % self._steps
                if int(self._slider.value) == self._steps - 1:
                    self._playing.clear()
                    self._play_button.label = "Play"

    # --- recording and end --------------------------------------------------------------------------------------------------

    def record(self, path: str | PathLike[str], *, steps_a_second: float = 20.0) -> None:
        """Write all instants as one HTML file that plays by itself, without a server.

        Args:
            path: The file.
            steps_a_second: How fast it plays.

        Raises:
            FrameError: The page is closed, or the speed is not positive.
        """
        if not (math.isfinite(steps_a_second) and steps_a_second > 0):
            raise FrameError(f"steps_a_second={steps_a_second!r}: it is a positive number")
        with self._lock:
            now = self._step
            self.show(0)
            recording = self._server.get_scene_serializer()
            for step in range(self._steps):
                self.show(step)
                recording.insert_sleep(1.0 / steps_a_second)
            self.show(now)
            Path(fspath(path)).write_text(recording.as_html(), encoding="utf-8")

    def close(self) -> None:
        """Close the page and free its port; a second call does nothing."""
        with self._lock:
            if self._closed.is_set():
                return
            self._closed.set()
        from jaxframes.view import guarded_viser

        guarded_viser.stop(self._server)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Frames3D of {len(self._tree.names)} frames at {self.url}{', closed' if self._closed.is_set() else ''}>"


def show_frames_3d(
    tree: FrameTree,
    states: States | None = None,
    *,
    times: Any = None,
    focus: str | None = None,
    distances: str = "true",
    trails: Sequence[str] = (),
    bodies: Mapping[str, float] | None = None,
    meshes: str | PathLike[str] | None = None,
    label_map: LabelMap | None = None,
    title: str = "Frames",
    port: int = PORT,
    host: str = "127.0.0.1",
    launch_client: bool = False,
) -> Frames3D:
    """Serve a tree as a 3-D page and return its handle at once: axes, links, labels, trails, bodies and meshes, in viser.

    Positions are worked out in float64 relative to the focus and divided by the range before they become float32, so that metres
    survive at astronomical distances. The page answers to its own address only, as that of ``jf.show_frames_graph`` does.

    Args:
        tree: The tree.
        states: One state (its joints get sliders), a batch of states with one axis, or a function of one instant that returns its state.
            Default: the neutral state.
        times: The instants, as in ``jf.to_html``.
        focus: Frame that stands still in the middle. Default: the root.
        distances: ``"true"`` proportions within the range that the reader chooses, or ``"logarithmic"`` to see all distances at once.
        trails: Frames whose way over all instants is drawn, in the axes of the focus.
        bodies: Radii in metres of see-through spheres around frames, such as ``{"earth": 6.378e6}``.
        meshes: Folder below which the mesh files of a tree from ``load_urdf`` are (``package://name/...`` is ``meshes/name/...``, or
            ``meshes/...``). Nothing outside of it is read, and nothing is fetched. Default: no meshes.
        label_map: What to write on frames, by their names or numbers. Default: their names.
        title: Title of the page.
        port: Port to listen at; 0 picks a free one.
        host: Address to listen at. Another one than the default shows the page to the network, unencrypted.
        launch_client: Whether to open a browser.

    Returns:
        The handle: ``url``, ``port``, ``show(step)``, ``update(state)``, ``record(path)``, ``close()``; a context manager.

    Raises:
        MissingExtraError: The extra ``view`` is not installed.
        UnknownFrameError: A name is no frame.
        FrameError: The port is taken, a mesh is missing, or an option has a value that it does not take.
    """
    require_viser()
    single = states is None or (isinstance(states, State) and not states.shape and times is None)
    instants = None if single else instants_of(states, times)
    state = one_instant(tree, states if isinstance(states, State) else None) if instants is None else instants.state(0)
    labels = labels_of(tree, label_map)
    contents = Contents(
        labels, frames_of(tree, trails, "trails"), bodies_of(tree, bodies), shapes_of(tree, meshes) if meshes is not None else ()
    )
    if distances not in DISTANCES:
        raise FrameError(f"distances={distances!r}: they are 'true' or 'logarithmic'")
    page = Frames3D(tree, state, instants, 0 if focus is None else tree.topology.index(focus), distances, contents)
    page._serve(host, port, title, launch_client)
    return page
