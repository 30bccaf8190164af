"""scripts/quality_table: its arithmetic on made-up runs, and one real run.

quality_table.py PROGRAMS: exits non-zero and says what is wrong.
"""
import importlib.machinery
import importlib.util
import math
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts/quality_table"
sys.dont_write_bytecode = True
sys.path.insert(0, str(SCRIPT.parent))
from bag_runs import Frame, Run  # noqa: E402


def load():
    loader = importlib.machinery.SourceFileLoader("quality_table", str(SCRIPT))
    spec = importlib.util.spec_from_loader("quality_table", loader)
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def frame(time, visible, error=None, depth=100):
    """A frame whose pose is off by `error` mm and deg; without a pose if there is none."""
    value = "" if error is None else str(error)
    return Frame({"stamp": "1", "time_s": str(time), "depth_mm": str(depth),
                  "position_mm": value, "orientation_deg": value, "nees": ""},
                 {"left_visible": str(visible), "right_visible": str(visible)})


def check(right, what):
    if not right:
        sys.exit("quality_table: " + what)


def check_success():
    frames = [frame(0, 1, 1), frame(1, 1, 3), frame(2, 1, 3, depth=200),
              frame(3, 1), frame(4, 0.2)]
    run = Run(frames, [3, 1, 2], {})
    check(run.success() == 50, f"2 of 4 frames that show enough are right, not {run.success()} %")
    check(abs(run.rms("position") - math.sqrt(19 / 3)) < 1e-9, "root mean square of 1, 3, 3")
    check(run.percentile(0.5) == 2, "median of 1, 2, 3")
    check(frame(0, 1, 11).wrong() and not frame(0, 1, 9).wrong(), "wrong beyond 10")


def check_losses(table):
    # Seen, hidden for four frames (declared in the third), back for two frames without a pose.
    errors = [1, 1, 5, 5, None, None, None, None, 1, 1]
    shares = [1, 1, 0, 0, 0, 0, 1, 1, 1, 1]
    frames = [frame(0.1 * i, share, error)
              for i, (share, error) in enumerate(zip(shares, errors))]
    found = table.losses(frames)
    check(len(found) == 1, "hidden once")
    declared, relocked = found[0]
    check(declared == 2, f"declared after two frames, not {declared}")
    check(abs(relocked - 0.2) < 1e-9, f"found again 0.2 s after its return, not {relocked}")
    for one in frames[2:6]:
        one.tracked = True
    check(table.losses(frames)[0][0] is None, "hidden too shortly to be declared lost")
    check(table.losses(frames[:6] + frames[2:6] * 3)[0][0] == math.inf, "never declared lost")
    for one in frames[6:]:
        one.tracked = False
    check(table.losses(frames)[0][1] == math.inf, "never found again")


def check_run(programs):
    done = subprocess.run(
        [SCRIPT, ROOT / "bags/x10_cube_textured.bag", "--seeds", "1", "--parts", "sweeps,trust",
         "--programs", programs], text=True, stdout=subprocess.PIPE, check=False)
    check(done.returncode == 0, "fails on a bundled bag")
    rows = [line.split("|")[1:-1] for line in done.stdout.splitlines()
            if line.startswith("| x10_cube_textured |")]
    check(len(rows) == 2, f"a row for the sweep and one for NEES, not {len(rows)}")
    position, bound = float(rows[0][2]), float(rows[0][3])
    check(0 < bound < 0.3 and 0 < position < 2, f"position {position} mm, bound {bound} mm")


def main():
    table = load()
    check_success()
    check_losses(table)
    check_run(sys.argv[1])
    print("success, losses and a bundled bag as they should be")


if __name__ == "__main__":
    main()
