"""The process that reads kernels: private, robust, gone when it is done with."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.spice.reading.worker import send
from tests.spice import made

PROBE = """
import sys
import jaxframes as jf
with jf.spice.Kernels(jf.spice.find_kernels()) as kernels:
    edge = kernels.translation(target="MOON", center="EARTH", start="2026-01-01", stop="2026-01-09")
    jf.spice.save(sys.argv[1], {"moon": edge, "earth": kernels.orientation(frame="ITRF93", start="2026-01-01", stop="2026-01-03")})
jf.spice.load(sys.argv[1])["moon"].evaluate(jf.Epoch.from_tdb("2026-01-05"))
assert "spiceypy" not in sys.modules
print("quiet")
"""


def test_this_process_never_imports_spiceypy_and_nothing_is_printed(tmp_path):
    done = subprocess.run([sys.executable, "-c", PROBE, str(tmp_path / "t.npz")], capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("quiet\n", 0), done.stderr


def pool(spice):
    return [spice.kdata(i, "ALL") for i in range(spice.ktotal("ALL"))], list(spice.gnpool("*", 0, 5000)), spice.erract("GET", 10, "")


def test_the_users_own_pool_is_untouched(cspice, paths, tmp_path, rng):
    cspice.unload(paths[0])
    before = pool(cspice)
    other = made.spk(tmp_path / "a.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 7))])
    with jf.spice.Kernels([*paths, other]) as kernels:
        kernels.translation(target=-77, center="MOON")
        assert pool(cspice) == before
    assert pool(cspice) == before
    with pytest.raises(cspice.exceptions.SpiceyError):
        cspice.spkez(-77, 100.0, "J2000", "NONE", 399)


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_the_process_ends_with_the_block_and_with_the_object(paths):
    with jf.spice.Kernels(paths[1]) as kernels:
        pid = kernels._pool.process._popen.pid
        assert alive(pid)
    assert not alive(pid)
    kernels.close()
    forgotten = jf.spice.Kernels(paths[1])
    pid = forgotten._pool.process._popen.pid
    del forgotten
    gc.collect()
    deadline = time.monotonic() + 10
    while alive(pid) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not alive(pid)


@pytest.mark.parametrize("end", [signal.SIGSEGV, signal.SIGKILL], ids=str)
def test_a_process_that_dies_says_whether_by_itself(paths, end):
    kernels = jf.spice.Kernels(paths[0])
    os.kill(kernels._pool.process._popen.pid, end)
    kind, words, after = {
        signal.SIGSEGV: (errors.BadKernelError, r"CSPICE broke down while .*\(exit code -11\): a kernel is damaged", "closed"),
        signal.SIGKILL: (
            errors.SpiceError,
            "ended from outside by SIGKILL while .*want of memory",
            "ended from outside by SIGKILL. Open them",
        ),
    }[end]
    with pytest.raises(kind, match=words) as found:
        kernels.translation(target="MOON", center="EARTH", start="2026-01-01", stop="2026-02-01")
    assert type(found.value) is kind
    with pytest.raises(errors.SpiceError, match=after):
        kernels.translation(target="MOON", center="EARTH", start="2026-01-01", stop="2026-02-01")


FORKED = """
import os, sys
import jaxframes as jf
with jf.spice.Kernels(sys.argv[1]) as kernels:
    pool = kernels._pool
    child = os.fork()
    if not child:
        for _ in range(20):
            try:
                print(pool.body_name(399), flush=True)
            except jf.FrameError as error:
                kind = str(error)
        print("child:", kind, flush=True)
        with jf.spice.Kernels(sys.argv[1]) as own:
            print("child:", own._pool.body_name(301), flush=True)
        kernels.close()
        os._exit(0)
    names = {pool.body_name(301) for _ in range(300)}
    os.waitpid(child, 0)
    print("parent:", names, pool.body_name(399))
"""


@pytest.mark.skipif(os.name == "nt", reason="there is no fork")
def test_a_fork_refuses_and_may_open_its_own(paths):
    """Both would read from one pipe, each some of the other's answers."""
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKED, paths[1]], capture_output=True, text=True, check=False, timeout=60)
    assert sorted(done.stdout.splitlines()) == [
        "child: MOON",
        "child: These kernels belong to the program that this one was forked from. Open them again here, or start processes by 'spawn': "
        "multiprocessing.get_context('spawn').",
        "parent: {'MOON'} EARTH",
    ], done.stderr


def test_closing_waits_for_no_other_thread(paths):
    kernels = jf.spice.Kernels(paths[1])
    process, failure = kernels._pool.process, []

    def ask():
        try:
            process.call("wait", 60.0, doing="sleeping")
        except errors.SpiceError as error:
            failure.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    while not process._lock.locked():
        time.sleep(0.001)
    started = time.monotonic()
    kernels.close()
    thread.join()
    assert time.monotonic() - started < 20  # of the sixty that the answer would take
    assert str(failure[0]) == "These kernels were closed by another thread while sleeping."
    assert process._popen.poll() is not None


def test_threads_take_turns(kernels):
    made_edges, failures = {}, []

    def work(month):
        try:
            made_edges[month] = kernels.translation(
                target="MOON", center="EARTH", start=f"2026-{month:02d}-01", stop=f"2026-{month:02d}-20"
            )
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=work, args=(month,)) for month in range(1, 9)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    for month, edge in made_edges.items():
        assert int(edge.coverage_code(jf.Epoch.from_tdb(f"2026-{month:02d}-10"))) == 0


def test_modules_beside_the_worker_do_not_shadow_others(tmp_path, paths, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "numpy.py").write_text("raise RuntimeError('shadowed')")
    with jf.spice.Kernels(paths[1]):
        pass


def long_folder(tmp_path, length):
    """A folder whose whole name has about so many characters."""
    folder = tmp_path
    while len(str(folder)) + 61 < length:
        folder = folder / ("x" * 60)
    folder = folder / ("y" * max(length - len(str(folder)) - 1, 1))
    folder.mkdir(parents=True)
    return folder


@pytest.mark.parametrize("length", [230, 245, 246, 260, 400, 900])
def test_names_longer_than_cspice_takes(tmp_path, rng, cspice, length):
    folder = long_folder(tmp_path, length)
    name = made.spk(tmp_path / "craft.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 7))])
    kernel = folder / "craft.bsp"
    os.replace(name, kernel)
    (folder / "names.tf").write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'CRAFT'\nNAIF_BODY_CODE += -77\n\\begintext\n")
    for paths in ([kernel, folder / "names.tf"], folder):
        with jf.spice.Kernels(paths) as kernels:
            edge = kernels.translation(target="CRAFT", center=399)
            assert [row[4] for row in kernels.coverage("CRAFT")] == ["craft.bsp"]
            links = kernels._pool._names._folder
        assert [source.name for source in edge.info.sources] == ["craft.bsp", "names.tf"]
        assert (links is not None) == (length > 245)
        assert links is None or not os.path.exists(links.name)


def test_a_name_that_cannot_be_made_shorter_says_so(tmp_path, rng, monkeypatch):
    folder = long_folder(tmp_path, 300)
    (folder / "names.tf").write_text("KPL/FK\n\\begindata\nA = 1\n\\begintext\n")
    monkeypatch.setattr("pathlib.Path.symlink_to", lambda *a, **k: (_ for _ in ()).throw(OSError("not allowed")))
    with pytest.raises(errors.BadKernelError, match=r"has 309 bytes, folders included; CSPICE takes 255.*not allowed.*Move the file"):
        jf.spice.Kernels(folder / "names.tf")


INTERRUPT = """
import os, signal, sys, threading, time
import jaxframes as jf
with jf.spice.Kernels(sys.argv[1]) as kernels:
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        kernels._pool.process.call("wait", 60.0, doing="sleeping")
    except KeyboardInterrupt:
        print("interrupted")
    try:
        print(kernels._pool.version())
    except jf.FrameError as error:
        print(error)
print(kernels, kernels._pool.process._popen.poll() is not None)
"""


def test_an_interrupted_request_ends_the_process_and_the_next_one_says_why(paths):
    started = time.monotonic()
    done = subprocess.run([sys.executable, "-c", INTERRUPT, paths[1]], capture_output=True, text=True, check=False)
    assert time.monotonic() - started < 50  # nothing waits for the answer
    first, second, third = done.stdout.splitlines()
    assert first == "interrupted", done.stderr
    assert second == (
        "These kernels are closed: a request was broken off while sleeping (KeyboardInterrupt), which ended the process that reads them. "
        "Open them again."
    )
    assert third == "Kernels(1 file, 0 bodies, closed) True"


def test_no_answer_is_taken_for_that_to_another_request(paths, monkeypatch):
    """Whatever breaks a request off: what is read is the answer to what was asked, or nothing."""
    with jf.spice.Kernels(paths[1]) as kernels:
        process = kernels._pool.process
        read = process._answer

        def broken():
            monkeypatch.setattr(process, "_answer", read)
            raise RuntimeError("broken off")

        monkeypatch.setattr(process, "_answer", broken)
        with pytest.raises(RuntimeError, match="broken off"):
            kernels._pool.body_name(399)
        with pytest.raises(errors.SpiceError, match=r"closed: a request was broken off while naming body 399 \(RuntimeError\)"):
            kernels._pool.version()
    with jf.spice.Kernels(paths[1]) as kernels:
        process = kernels._pool.process
        send(process._popen.stdin, (0, "version", ()))  # whose answer stays in the pipe
        with pytest.raises(errors.SpiceError, match=r"answered request 0, not \d+, while naming body 399"):
            kernels._pool.body_name(399)
        assert process.closed


@pytest.mark.skipif(os.name == "nt", reason="sessions and signals of POSIX")
def test_an_interrupt_from_the_terminal_does_not_reach_the_process(paths):
    with jf.spice.Kernels(paths[1]) as kernels:
        process = kernels._pool.process._popen
        assert os.getsid(process.pid) == process.pid != os.getsid(0)  # Ctrl-C goes to the processes of the terminal's session
        os.kill(process.pid, signal.SIGINT)
        assert kernels._pool.version().startswith("CSPICE")
