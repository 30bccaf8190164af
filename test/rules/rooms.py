"""The arrows between the rooms: reads every include line and compares it with the table.

Exits non-zero and names file and line for each include that the table does not allow.
"""
import pathlib
import re
import sys

ROOMS = {
    # room: (rooms it may include, further headers it may not include)
    "geometry": set(),
    "leap": {"geometry"},
    "rectification": {"geometry"},
    "tracking": {"geometry"},
    "simulation": {"geometry"},
    "evaluation": {"geometry"},
    "ros": {"geometry", "leap", "rectification", "tracking", "simulation", "evaluation"},
}
# Headers that mean ROS: anything below these folders of the include path.
ROS = re.compile(
    r"^(ros|rosbag|roscpp|nodelet|pluginlib|tf2|tf2_ros|tf2_eigen|image_transport|cv_bridge|"
    r"message_filters|diagnostic_updater|dynamic_reconfigure|camera_info_manager|"
    r"[a-z0-9_]+_msgs|std_srvs)/")
ONLY_IN = {"libusb": {"leap"}, "libusb-1.0": {"leap"}, "embree3": {"simulation"}}
PACKAGE = "leap_object_tracker/"
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def complaint(room, header, angled):
    top = header.split("/")[0]
    if ROS.match(header) and room != "ros":
        return "ROS belongs to the room ros alone"
    if top in ONLY_IN and room not in ONLY_IN[top] | {"ros"}:
        return f"{top} belongs to the room {', '.join(sorted(ONLY_IN[top]))}"
    if header.startswith(PACKAGE):
        other = header[len(PACKAGE):].split("/")[0]
        if "/" not in header[len(PACKAGE):]:  # a generated message
            return None if room == "ros" else "messages belong to the room ros alone"
        if other not in ROOMS:
            return f"there is no room '{other}'"
        if other != room and other not in ROOMS[room]:
            return f"the room {room} does not see {other}"
    elif not angled and "/" in header and header.split("/")[0] in ROOMS:
        other = header.split("/")[0]
        if other != room and other not in ROOMS[room]:
            return f"the room {room} does not see {other}"
    elif not angled and ".." in header:
        return "a path with '..' leaves the room"
    return None


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    files = complaints = 0
    for room in ROOMS:
        for folder in (root / "src" / room, root / "include" / "leap_object_tracker" / room):
            for path in sorted(folder.rglob("*")):
                if path.suffix not in {".cpp", ".hpp", ".h", ".cc", ".in"}:
                    continue
                files += 1
                for number, line in enumerate(path.read_text().splitlines(), 1):
                    match = INCLUDE.match(line)
                    why = match and complaint(room, match.group(2), match.group(1) == "<")
                    if why:
                        complaints += 1
                        print(f"{path.relative_to(root)}:{number}: {match.group(2)}: {why}")
    for folder in (root / "src", root / "include" / "leap_object_tracker"):
        for path in folder.iterdir():
            if path.name not in ROOMS:
                complaints += 1
                print(f"{path.relative_to(root)}: not a room")
    print(f"{files} files, {complaints} complaints")
    return 1 if complaints or files < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
