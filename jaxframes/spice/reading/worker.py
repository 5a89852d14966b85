"""The process that reads kernels: run by file path, it imports spiceypy and numpy only and answers requests on its pipes.

A CSPICE kernel pool belongs to a process. Reading in another process leaves the user's own pool as it is, works from any thread,
and turns a crash of CSPICE on a damaged kernel into an exception. Requests and answers are pickles with a length in front; what CSPICE
prints goes nowhere near them.
"""

import os
import pickle
import signal
import struct
import sys
import time
from typing import Any, BinaryIO

SLICE = 1 << 20  # words read at a time
CELL = 20_000  # numbers that one of CSPICE's cells has room for, at first
MOST_CELL = 1 << 25
MOST_SEGMENTS = 1_000_000  # in one file: a damaged list may run in a circle


def send(stream: BinaryIO, message: object) -> None:
    """Write one message."""
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(struct.pack("<Q", len(data)))
    stream.write(data)
    stream.flush()


def receive(stream: BinaryIO) -> Any:
    """Read one message; raises EOFError where the stream ends."""
    header = _exactly(stream, 8)
    return pickle.loads(_exactly(stream, struct.unpack("<Q", header)[0]))


def _exactly(stream: BinaryIO, count: int) -> bytes:
    data = stream.read(count)
    if data is None or len(data) < count:
        raise EOFError("the stream ended within a message")
    return data


class Reader:
    """The requests that the worker answers, each a method."""

    def __init__(self) -> None:
        import numpy
        import spiceypy

        self.numpy, self.spice = numpy, spiceypy
        spiceypy.erract("SET", 10, "RETURN")
        spiceypy.errprt("SET", 10, "NONE")

    def version(self) -> str:
        """Return the version of CSPICE."""
        return self.spice.tkvrsn("TOOLKIT")

    def wait(self, seconds: float) -> None:
        """Answer later: what a call of CSPICE that hangs looks like from outside."""
        time.sleep(seconds)

    def kind(self, path: str) -> tuple[str, str]:
        """Return the architecture and type of a file, ("?", "?") if it is no kernel."""
        return self.spice.getfat(path)

    def load(self, path: str) -> None:
        """Load a kernel into the pool of this process."""
        self.spice.furnsh(path)

    def segments(self) -> list[dict[str, Any]]:
        """Return the segments of all binary SPK and PCK files loaded, in order of loading: later ones win."""
        found = []
        for file_kind in ("SPK", "PCK"):
            for i in range(self.spice.ktotal(file_kind)):
                path, _, _, handle = self.spice.kdata(i, file_kind)[:4]
                found += self._file_segments(file_kind, path, handle)
        return found

    def _file_segments(self, file_kind: str, path: str, handle: int) -> list[dict[str, Any]]:
        doubles, integers = (2, 6) if file_kind == "SPK" else (2, 5)
        found = []
        self.spice.dafbfs(handle)
        while self.spice.daffna():
            if len(found) >= MOST_SEGMENTS:
                raise RuntimeError("the file's list of segments does not end")
            summary = self.spice.dafgs()
            dc, ic = self.spice.dafus(summary, doubles, integers)
            ic = [int(i) for i in ic]
            body, *center, frame, data_type, first, last = ic
            found.append(
                {
                    "kind": file_kind,
                    "path": path,
                    "handle": handle,
                    "body": body,
                    "center": center[0] if center else 0,
                    "frame": frame,
                    "type": data_type,
                    "begin": float(dc[0]),
                    "end": float(dc[1]),
                    "first": first,
                    "last": last,
                    "directory": self._directory(handle, data_type, first, last, os.path.getsize(path)),
                    "name": self.spice.dafgn(64).strip(),
                }
            )
        return found

    def _directory(self, handle: int, data_type: int, first: int, last: int, size: int) -> tuple[float, ...] | None:
        """Return the last four words of a Chebyshev segment, or None where the file ends before them."""
        if data_type not in (2, 3) or not 0 < first <= last - 4 or last * 8 > size:
            return None
        return tuple(float(w) for w in self.spice.dafgda(handle, last - 3, last))

    def words(self, handle: int, first: int, last: int) -> Any:
        """Return the double-precision words first..last (counted from one) of a file as an array."""
        parts = [self.spice.dafgda(handle, a, min(a + SLICE - 1, last)) for a in range(first, last + 1, SLICE)]
        return self.numpy.concatenate([self.numpy.asarray(p, "<f8") for p in parts])

    def body(self, name: str) -> int | None:
        """Return the id of a body by name or by a number as text, None if unknown."""
        try:
            return int(self.spice.bods2c(name))
        except self.spice.NotFoundError:
            return None

    def body_name(self, body: int) -> str:
        """Return the name of a body, or its number as text."""
        try:
            return self.spice.bodc2n(body)
        except self.spice.NotFoundError:
            return str(body)

    def body_names(self, bodies: list[int]) -> list[str]:
        """Return the names of those bodies that have one."""
        names = (self.body_name(body) for body in bodies)
        return sorted({name for name in names if not name.lstrip("-").isdigit()})

    def frame(self, name: str) -> dict[str, Any] | None:
        """Return id, name, center, class and class id of a frame by name or by a number as text, None if unknown."""
        number = int(name) if name.lstrip("-").isdigit() else int(self.spice.namfrm(name))
        try:
            center, frame_class, class_id = self.spice.frinfo(number)
        except self.spice.NotFoundError:
            return None
        return {
            "id": number,
            "name": self.spice.frmnam(number),
            "center": int(center),
            "frame_class": int(frame_class),
            "class_id": int(class_id),
        }

    def all_frames(self) -> list[dict[str, Any]]:
        """Return what ``frame`` says of all frames, built in and defined by text kernels."""
        return [found for number in self._frame_ids() if (found := self.frame(str(number))) is not None]

    def _frame_ids(self) -> list[int]:
        """Return the ids of all frames, built in and defined by text kernels."""
        found = (self._in_cell(self.spice.cell_int, lambda cell, of=of: of(-1, cell)) for of in (self.spice.bltfrm, self.spice.kplfrm))
        return sorted({int(i) for cell in found for i in cell})

    def _in_cell(self, make: Any, fill: Any) -> Any:
        """Return the cell that a call fills, made larger until all has room in it."""
        size = CELL
        while True:
            try:
                return fill(make(size))
            except self.spice.exceptions.SpiceyError as error:
                if error.short not in ("SPICE(SETTOOSMALL)", "SPICE(WINDOWEXCESS)", "SPICE(CELLTOOSMALL)") or size > MOST_CELL:
                    raise
                size *= 4

    def body_frame(self, body: int) -> int | None:
        """Return the id of the frame that a body is given by SPICE or an association kernel, None if it has none."""
        try:
            return int(self.spice.cidfrm(body)[0])
        except self.spice.NotFoundError:
            return None

    def files(self, kinds: list[str]) -> list[str]:
        """Return the paths of the kernels of some kinds, those that meta-kernels name and the meta-kernels too, in order of loading."""
        listed = [self.spice.kdata(i, "ALL")[:2] for i in range(self.spice.ktotal("ALL"))]
        return [path for path, kind in listed if kind in kinds or "ALL" in kinds]

    def numbers(self, names: list[str]) -> dict[str, list[float] | None]:
        """Return the numbers of kernel-pool variables, None for those that do not exist or hold text."""
        found: dict[str, list[float] | None] = {}
        for name in names:
            try:
                count, kind = self.spice.dtpool(name)
                found[name] = [float(x) for x in self.spice.gdpool(name, 0, count)] if kind == "N" else None
            except self.spice.NotFoundError:
                found[name] = None
        return found

    def fixed_offset(self, frame: int) -> tuple[list[list[float]], int]:
        """Return the matrix that takes coordinates of a fixed-offset (TK) frame to its base, and the id of the base."""
        matrix, base = self.spice.tkfram(frame)[:2]
        return [[float(x) for x in row] for row in matrix], int(base)

    def rotation(self, source: str, destination: str) -> list[list[float]]:
        """Return the matrix that takes coordinates from one inertial frame to another."""
        return [[float(x) for x in row] for row in self.spice.pxform(source, destination, 0.0)]

    def states(self, target: int, center: int, frame: str, times: Any, correction: str = "NONE") -> Any:
        """Return states of a body, [n, 6] in km and km/s, at ET seconds; geometric or with one of SPICE's aberration corrections."""
        return self.numpy.array([self.spice.spkez(target, float(t), frame, correction, center)[0] for t in times]).reshape(-1, 6)

    def rotations(self, frame: str, relative_to: str, times: Any) -> Any:
        """Return rotation matrices [n, 3, 3] from a frame to another and angular velocities [n, 3] of it there, at ET seconds."""
        found = [self.spice.xf2rav(self.spice.sxform(relative_to, frame, float(t))) for t in times]
        return self.numpy.array([m.T for m, _ in found]), self.numpy.array([w for _, w in found])

    def rotations_or_nan(self, frame: str, relative_to: str, times: Any) -> Any:
        """Return what ``rotations`` does, NaN at the epochs that CSPICE has no answer for."""
        rotations, rates = self.numpy.full((len(times), 3, 3), self.numpy.nan), self.numpy.full((len(times), 3), self.numpy.nan)
        for i, t in enumerate(times):
            try:
                matrix, rate = self.spice.xf2rav(self.spice.sxform(relative_to, frame, float(t)))
            except self.spice.exceptions.SpiceyError:
                continue
            rotations[i], rates[i] = matrix.T, rate
        return rotations, rates

    def attitudes_or_nan(self, frame: str, relative_to: str, times: Any) -> Any:
        """Return what ``rotations_or_nan`` does; where CSPICE has a rotation but no rate, that alone."""
        rotations, rates = self.rotations_or_nan(frame, relative_to, times)
        for i in self.numpy.flatnonzero(~self.numpy.isfinite(rotations).all((1, 2))):
            try:
                rotations[i] = self.spice.pxform(frame, relative_to, float(times[i]))
            except self.spice.exceptions.SpiceyError:
                continue
        return rotations, rates

    def ck_segments(self) -> list[dict[str, Any]]:
        """Return the segments of all C-kernels loaded, in order of loading; times are encoded ticks."""
        found = []
        for i in range(self.spice.ktotal("CK")):
            path, _, _, handle = self.spice.kdata(i, "CK")[:4]
            size, before = os.path.getsize(path), len(found)
            self.spice.dafbfs(handle)
            while self.spice.daffna():
                if len(found) - before >= MOST_SEGMENTS:
                    raise RuntimeError("the file's list of segments does not end")
                dc, ic = self.spice.dafus(self.spice.dafgs(), 2, 6)
                instrument, frame, data_type, rates, first, last = (int(k) for k in ic)
                if not 0 < first <= last or last * 8 > size:
                    raise RuntimeError(f"a segment of {path} lies outside the file")
                found.append(
                    {
                        "path": path,
                        "handle": handle,
                        "instrument": instrument,
                        "frame": frame,
                        "type": data_type,
                        "has_rates": bool(rates) or data_type == 2,
                        "begin": float(dc[0]),
                        "end": float(dc[1]),
                        "first": first,
                        "last": last,
                        "name": self.spice.dafgn(64).strip(),
                    }
                )
        return found

    def binary_files(self) -> list[str]:
        """Return the paths of all binary kernels loaded."""
        kinds = ("SPK", "PCK", "CK", "DSK", "EK")
        return [self.spice.kdata(i, kind)[0] for kind in kinds for i in range(self.spice.ktotal(kind))]

    def ck_windows(self, path: str, instrument: int, rates: bool) -> list[tuple[float, float]]:
        """Return the spans of ET seconds that a C-kernel has attitudes of an instrument in, or attitudes with rates."""
        cover = self._in_cell(self.spice.cell_double, lambda cell: self.spice.ckcov(path, instrument, rates, "INTERVAL", 0.0, "TDB", cell))
        return [tuple(self.spice.wnfetd(cover, i)) for i in range(self.spice.wncard(cover))]

    def clock(self, ck_id: int) -> int:
        """Return the id of the clock that a CK id counts in."""
        return int(self.spice.ckmeta(ck_id, "SCLK"))

    def ticks_to_et(self, clock: int, ticks: Any) -> Any:
        """Return ET seconds of encoded ticks."""
        return self.numpy.array([self.spice.sct2e(clock, float(t)) for t in ticks])

    def instants(self, name: str) -> list[float]:
        """Return the instants that a kernel variable holds as ET seconds, none if it does not exist; text is read as a time."""
        try:
            count, kind = self.spice.dtpool(name)
        except self.spice.NotFoundError:
            return []
        if kind == "N":
            return [float(x) for x in self.spice.gdpool(name, 0, count)]
        return [float(self.spice.str2et(x)) for x in self.spice.gcpool(name, 0, count)]


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer requests (number, method, arguments) with (number, "ok", result) or (number, "failed", name, text) until the stream ends.

    The number tells whoever reads an answer which request it is for; that the process started, or could not, is answer 0.
    """
    try:
        reader = Reader()
    except Exception as error:
        send(answers, (0, "failed", type(error).__name__, str(error)))
        return
    send(answers, (0, "ok", None))
    while True:
        try:
            number, method, arguments = receive(requests)
        except EOFError:
            return
        try:
            answer = (number, "ok", getattr(reader, method)(*arguments))
        except Exception as error:
            short = getattr(error, "short", type(error).__name__)
            text = getattr(error, "long", "") or getattr(error, "explain", "") or str(error)
            answer = (number, "failed", str(short), " ".join(str(text).split()))
        send(answers, answer)


def main() -> None:
    """Keep the real output for answers only, leave interrupts to the process that asks, and serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if os.name == "nt":
        import msvcrt

        for descriptor in (0, 1):
            msvcrt.setmode(descriptor, os.O_BINARY)  # pyright: ignore[reportAttributeAccessIssue]
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    main()
