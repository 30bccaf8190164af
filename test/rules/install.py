"""Installs the build into an empty folder and uses the package from there alone.

install.py BUILD_FOLDER SOURCE_FOLDER: exits non-zero and says what is missing.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

FILES = [
    "lib/leap_object_tracker/track_bag", "lib/leap_object_tracker/evaluate",
    "lib/libleap_nodelets.so", "share/leap_object_tracker/package.xml",
    "share/leap_object_tracker/config/nodelets.xml",
    "share/leap_object_tracker/config/tracker.yaml",
    "share/leap_object_tracker/config/objects/prism.yaml",
    "share/leap_object_tracker/config/udev",
    "share/leap_object_tracker/launch/leap.launch",
    "share/leap_object_tracker/launch/playback.launch",
    "share/leap_object_tracker/bags/wobble_prism.bag",
    "include/leap_object_tracker/tracking/tracker.hpp",
    "include/leap_object_tracker/TrackerStatus.h",
]


def main():
    build, source = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        prefix = pathlib.Path(folder) / "install"
        subprocess.run(["cmake", "-DCMAKE_INSTALL_PREFIX=" + str(prefix), "-P",
                        build + "/cmake_install.cmake"], check=True, stdout=subprocess.DEVNULL)
        missing = [name for name in FILES if not (prefix / name).exists()]
        if missing:
            sys.exit("not installed: " + ", ".join(missing))

        # Nothing of the build or of the source may be needed.
        clean = {"PATH": "/usr/bin:/bin", "HOME": folder,
                 "ROS_PACKAGE_PATH": str(prefix / "share"), "CMAKE_PREFIX_PATH": str(prefix)}
        program = prefix / "lib/leap_object_tracker/track_bag"
        libraries = subprocess.run(["ldd", program], env=clean, check=True, text=True,
                                   stdout=subprocess.PIPE).stdout
        for line in libraries.splitlines():
            if "not found" in line or build in line or source in line:
                sys.exit("a library is not taken from the installation: " + line.strip())
        share = prefix / "share/leap_object_tracker"
        subprocess.run([program, share / "bags/wobble_prism.bag", "--object",
                        share / "config/objects/prism.yaml", "--config",
                        share / "config/tracker.yaml", "--out", folder + "/poses.tum"],
                       env=clean, check=True)
        poses = [line for line in open(folder + "/poses.tum") if not line.startswith("#")]
        if len(poses) < 10:
            sys.exit(f"only {len(poses)} poses were tracked")
        launch = subprocess.run(
            ["roslaunch", "--files", "leap_object_tracker", "playback.launch", "bag:=x",
             "object:=y"], env={**clean, "ROS_HOME": folder}, check=True, text=True,
            stdout=subprocess.PIPE).stdout
        if os.fspath(share) not in launch:
            sys.exit("roslaunch takes the launch file from elsewhere: " + launch)
    print(f"{len(FILES)} files there, track_bag runs from the installation")


if __name__ == "__main__":
    main()
