"""Every bundled bag is described, named with command and seed, and all together stay small."""
import pathlib
import sys

MOST_BYTES = 20e6


def main():
    folder = pathlib.Path(__file__).resolve().parents[2] / "bags"
    readme = (folder / "README.md").read_text()
    bags = sorted(folder.glob("*.bag"))
    complaints = [f"{bag.name}: not in bags/README.md with its command and --seed" for bag in bags
                  if not any(bag.name in line and "--seed" in line for line in readme.splitlines())]
    size = sum(bag.stat().st_size for bag in bags)
    if size > MOST_BYTES:
        complaints.append(f"the bags take {size / 1e6:.1f} MB; {MOST_BYTES / 1e6:.0f} MB at most")
    if not bags:
        complaints.append("there is no bag")
    print("\n".join(complaints) or f"{len(bags)} bags, {size / 1e6:.1f} MB")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
