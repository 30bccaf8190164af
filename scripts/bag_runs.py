"""What the scripts that measure on bags share: bags, their objects, and runs of the programs."""
import csv
import math
import os
import pathlib
import statistics
import subprocess
import tempfile

import rosbag
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAMS = ROOT / "build/devel/lib/leap_object_tracker"
NEAR = 150.0  # [mm] up to which 2 mm and 2 deg are asked for, beyond: 5 mm and 5 deg
HALF = 0.5    # visible share of the object from which on a frame counts


def bags_of(paths, word=""):
    """Bags of files and folders whose name holds the word."""
    bags = []
    for path in paths:
        bags += sorted(path.glob("*.bag")) if path.is_dir() else [path]
    return [bag for bag in bags if word in bag.name]


def object_of(bag):
    """BAG.yaml beside the bag, or the object of the scene of the same name."""
    beside = bag.with_suffix(".yaml")
    if beside.exists():
        return beside
    scene = ROOT / "config/scenes" / beside.name
    while scene.exists():
        tree = yaml.safe_load(scene.read_text())
        if "file" in tree.get("object", {}):
            return (scene.parent / tree["object"]["file"]).resolve()
        if "based_on" not in tree:
            break
        scene = scene.parent / tree["based_on"]
    raise RuntimeError(f"no object for '{bag}': neither '{beside}' nor a scene of that name")


def run(command):
    """The output of a program. Raises RuntimeError with its message."""
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or f"{command[0]} failed")
    return done.stdout


class Frame:
    """One frame of one run."""

    def __init__(self, error, bound):
        number = {name: float(value) if value else None for name, value in error.items()}
        self.time = number["time_s"]
        self.depth = number["depth_mm"]
        self.tracked = number["position_mm"] is not None
        self.position = number["position_mm"]
        self.orientation = number["orientation_deg"]
        self.nees = number["nees"]
        self.visible = 0.5 * (float(bound["left_visible"]) + float(bound["right_visible"]))
        self.least_visible = min(float(bound["left_visible"]), float(bound["right_visible"]))

    def within(self, millimetres, degrees):
        return self.tracked and self.position <= millimetres and self.orientation <= degrees

    def good(self):
        return self.within(2, 2) if self.depth <= NEAR else self.within(5, 5)

    def wrong(self):
        return self.tracked and not self.within(10, 10)


class Run:
    """One bag tracked once."""

    def __init__(self, frames, milliseconds, figures):
        self.frames = frames
        self.milliseconds = sorted(milliseconds)
        self.figures = figures  # of evaluate

    def shown(self):
        return [frame for frame in self.frames if frame.visible >= HALF]

    def success(self):
        shown = self.shown()
        return share(sum(frame.good() for frame in shown), len(shown))

    def rms(self, member):
        values = [getattr(frame, member) for frame in self.shown() if frame.tracked]
        return math.sqrt(statistics.mean(v * v for v in values)) if values else math.nan

    def percentile(self, part):
        return self.milliseconds[int(part * (len(self.milliseconds) - 1))]


class Runs:
    """Tracks bags, once for each seed, and keeps what came out. `options` has seeds, programs, config
    and method."""

    def __init__(self, options, folder, start="search"):
        self.options = options
        self.folder = folder
        self.start = start
        self.judged = {}

    def of(self, bag, every=1):
        """The runs of all seeds."""
        if (bag, every) not in self.judged:
            with tempfile.TemporaryDirectory(dir=self.folder) as folder:
                unpacked = pathlib.Path(folder) / bag.name
                self.judged[bag, every] = [self.one(bag, unpacked, seed, every)
                                           for seed in range(1, self.options.seeds + 1)]
        return self.judged[bag, every]

    def fresh(self, paths, bag, program):
        """Are all files newer than the bag, the program, and the libraries of the tracker?"""
        sources = [bag, program]
        if program.name == "track_bag":
            sources += [self.options.programs.parent / f"libleap_{room}.so"
                        for room in ("tracking", "rectification", "geometry")]
        newest = max(os.path.getmtime(path) for path in sources)
        return all(path.exists() and os.path.getmtime(path) > newest for path in paths)

    def bounds(self, bag):
        """Rows of fisher_bound and the true poses as a file."""
        table, truth = (self.folder / f"{bag.stem}.{end}" for end in ("bound.csv", "truth.tum"))
        if not self.fresh([table, truth], bag, self.options.programs / "fisher_bound"):
            run([self.options.programs / "fisher_bound", bag, "--object", object_of(bag), "--csv",
                 table, "--truth", truth])
        return rows_of(table), truth

    def bound_rms(self, bag):
        """Position [mm] and orientation [deg] over the frames that show half of the object."""
        rows = [row for row in self.bounds(bag)[0] if row["position_bound_mm"]
                and float(row["left_visible"]) + float(row["right_visible"]) >= 2 * HALF]
        return [math.sqrt(statistics.mean(float(row[name]) ** 2 for row in rows))
                for name in ("position_bound_mm", "orientation_bound_deg")]

    def one(self, bag, unpacked, seed, every):
        stem = f"{bag.stem}_{self.start}_{seed}_{every}"
        poses, times, covariances = (self.folder / f"{stem}.{end}"
                                     for end in ("tum", "times.csv", "cov.csv"))
        program = self.options.programs / "track_bag"
        if not self.fresh([poses, times, covariances], bag, program):
            unpack(bag, unpacked)
            command = [program, unpacked, "--object", object_of(bag), "--out", poses, "--timing", times,
                       "--covariances", covariances, "--seed", seed, "--every", every, "--start",
                       self.start]
            for name in ("method", "config"):
                if getattr(self.options, name):
                    command += ["--" + name, getattr(self.options, name)]
            if bag.name.startswith("eye_in_hand"):
                command += ["--fixed-frame", "base_link"]
            run(command)
        return self.judge(bag, stem, covariances)

    def judge(self, bag, stem, covariances=None):
        """The run whose poses and times are STEM.tum and STEM.times.csv."""
        bounds, truth = self.bounds(bag)
        poses, times, errors, figures = (self.folder / f"{stem}.{end}" for end in
                                         ("tum", "times.csv", "frames.csv", "figures.csv"))
        command = [self.options.programs / "evaluate", poses, truth, "--object", object_of(bag),
                   "--timing", times, "--csv", figures, "--frames", errors]
        if covariances and any(line[:1].isdigit() for line in poses.read_text().splitlines()):
            command += ["--covariances", covariances]
        run(command)
        # One bound belongs to each frame: the one nearest in time.
        stamps = [float(row["stamp"]) for row in bounds]
        frames, at = [], 0
        for error in rows_of(errors):
            stamp = float(error["stamp"])
            while at + 1 < len(stamps) and abs(stamps[at + 1] - stamp) <= abs(stamps[at] - stamp):
                at += 1
            frames.append(Frame(error, bounds[at]))
        return Run(frames, [float(row["total_ms"]) for row in rows_of(times)], rows_of(figures)[0])


def unpack(bag, unpacked):
    """Copies a bag without its compression, which takes longer to undo than the tracking."""
    if unpacked.exists():
        return
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(unpacked), "w") as target:
        for topic, message, stamp in source.read_messages(raw=True):
            target.write(topic, message, stamp, raw=True)


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def share(part, of):
    """[%]"""
    return 100 * part / of if of else math.nan


def median(values):
    values = [value for value in values if not math.isnan(value)]
    return statistics.median(values) if values else math.nan


def text(value, decimals):
    return "-" if math.isnan(value) else f"{value:.{decimals}f}"


def heading(title, columns):
    print(f"\n**{title}**\n\n| " + " | ".join(columns) + " |\n|---|" +
          "---:|" * (len(columns) - 1))


def line(cells):
    print("| " + " | ".join(cells) + " |", flush=True)
