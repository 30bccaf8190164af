"""Every C++ file stands as clang-format would write it; names those that do not."""
import pathlib
import subprocess
import sys


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    files = [path for folder in ("include", "src", "test") for path in (root / folder).rglob("*")
             if path.suffix in {".hpp", ".cpp"}]
    wrong = [path for path in files
             if subprocess.run(["clang-format", "--dry-run", "-Werror", path],
                               stderr=subprocess.DEVNULL, check=False).returncode != 0]
    for path in wrong:
        print(f"{path.relative_to(root)}: run clang-format -i on it")
    print(f"{len(files)} files, {len(wrong)} to be formatted")
    return 1 if wrong or len(files) < 50 else 0


if __name__ == "__main__":
    sys.exit(main())
