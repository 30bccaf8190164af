"""What the scripts that measure on bags share: bags, their objects, and runs of the programs."""
import pathlib
import subprocess

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAMS = ROOT / "build/devel/lib/leap_object_tracker"


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
