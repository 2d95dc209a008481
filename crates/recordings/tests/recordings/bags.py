"""Creates the ROS 2 bags of this folder with rosbags 0.11.9 (`pip install rosbags==0.11.9`).

Usage: `python3 crates/recordings/tests/recordings/bags.py crates/recordings/tests/recordings/bags`.

The motion is synthetic: two vehicles that pass each other, and a robot with transforms `map -> odom -> base_link`.
"""

import math
import shutil
import sys
from pathlib import Path

import numpy
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from ruamel.yaml import YAML

SECOND = 1_700_000_000
STORE = get_typestore(Stores.ROS2_HUMBLE)
for text, name in (
    ("string name\ngeometry_msgs/Pose pose\n", "motion_capture_tracking_interfaces/msg/NamedPose"),
    (
        "std_msgs/Header header\nmotion_capture_tracking_interfaces/NamedPose[] poses\n",
        "motion_capture_tracking_interfaces/msg/NamedPoseArray",
    ),
):
    STORE.register(get_types_from_msg(text, name))


def make(kind, /, **fields):
    return STORE.types[kind](**fields)


def header(ns, frame):
    stamp = make("builtin_interfaces/msg/Time", sec=SECOND + ns // 10**9, nanosec=ns % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector(x, y, z, kind="Vector3"):
    return make(f"geometry_msgs/msg/{kind}", x=float(x), y=float(y), z=float(z))


def turn(yaw):
    return make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def pose(x, y, z, yaw=0.0):
    return make("geometry_msgs/msg/Pose", position=vector(x, y, z, "Point"), orientation=turn(yaw))


def covariant(x, y, z, yaw=0.0):
    return make("geometry_msgs/msg/PoseWithCovariance", pose=pose(x, y, z, yaw), covariance=numpy.zeros(36))


def odometry(ns, frame, child, x, y, z, yaw):
    twist = make("geometry_msgs/msg/Twist", linear=vector(1, 0, 0), angular=vector(0, 0, 0))
    twist = make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=numpy.zeros(36))
    fields = {"child_frame_id": child, "pose": covariant(x, y, z, yaw), "twist": twist}
    return make("nav_msgs/msg/Odometry", header=header(ns, frame), **fields)


def transform(ns, parent, child, x, y, z, yaw=0.0):
    moved = make("geometry_msgs/msg/Transform", translation=vector(x, y, z), rotation=turn(yaw))
    return make("geometry_msgs/msg/TransformStamped", header=header(ns, parent), child_frame_id=child, transform=moved)


def transforms(*parts):
    return make("tf2_msgs/msg/TFMessage", transforms=list(parts))


def write(folder, messages, packed=False):
    """Writes messages (time in ns, topic, message) as one bag."""
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.FILE if packed else CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for ns, topic, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], SECOND * 10**9 + ns, STORE.serialize_cdr(message, kind))


def join(folder, parts):
    """Makes one bag of several, as rosbag2 splits them: a folder with all files and one list of them."""
    folder.mkdir(parents=True)
    yaml = YAML()
    whole = None
    for number, part in enumerate(parts):
        bag = yaml.load(part / "metadata.yaml")["rosbag2_bagfile_information"]
        (file,) = bag["files"]
        name = f"{folder.name}_{number}{''.join(Path(file['path']).suffixes)}"
        shutil.copy(part / file["path"], folder / name)
        file["path"] = name
        if whole is None:
            whole = bag
            whole["relative_file_paths"] = []
        else:
            whole["files"].append(file)
            whole["message_count"] += bag["message_count"]
            for topic, more in zip(whole["topics_with_message_count"], bag["topics_with_message_count"], strict=True):
                topic["message_count"] += more["message_count"]
            end = bag["starting_time"]["nanoseconds_since_epoch"] + bag["duration"]["nanoseconds"]
            whole["duration"]["nanoseconds"] = end - whole["starting_time"]["nanoseconds_since_epoch"]
        whole["relative_file_paths"].append(name)
    with (folder / "metadata.yaml").open("w") as out:
        yaml.dump({"rosbag2_bagfile_information": whole}, out)


def crazyflies(ns):
    """Two vehicles that pass each other at a distance of 0.5 m, by name."""
    x = ns / 1e9
    named = [("cf1", pose(x - 1, 0, 1)), ("cf2", pose(1 - x, 0.5, 1))]
    named = [make("motion_capture_tracking_interfaces/msg/NamedPose", name=name, pose=pose) for name, pose in named]
    kind = "motion_capture_tracking_interfaces/msg/NamedPoseArray"
    return ns, "/poses", make(kind, header=header(ns, "world"), poses=named)


def swarm(ns):
    return ns, "/tf", transforms(
        transform(ns, "world", "cf1", ns / 1e9 - 1, 0, 1), transform(ns, "world", "cf2", 1 - ns / 1e9, 0.5, 1)
    )


def robot(ns):
    """Odometry at 10 Hz along x of a frame that is turned by a quarter and moves at 1 Hz along y of the map."""
    yield ns, "/tf", transforms(transform(ns, "odom", "base_link", ns / 1e9, 0, 0))
    yield ns, "/odom", odometry(ns, "odom", "base_link", ns / 1e9, 0, 0, 0)
    if ns % 500_000_000 == 0:
        yield ns, "/tf", transforms(transform(ns, "map", "odom", 0, ns / 1e9, 0, math.pi / 2))


def robots(ns, carried):
    """Two robots side by side, 2 m apart, on odometry that drifts; `carried` says whether the drift is told now."""
    for k, y in ((1, 0), (2, 2)):
        yield ns, "/tf", transforms(transform(ns, f"r{k}/odom", f"r{k}/base_link", ns / 1e9, 0, 0))
        if carried:
            yield ns, "/tf", transforms(transform(ns, "map", f"r{k}/odom", 0, y + ns / 1e10, 0))


def main(out):
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    times = [k * 100_000_000 for k in range(21)]
    write(out / "crazyswarm", [entry for ns in times for entry in (crazyflies(ns), swarm(ns))])
    halves = []
    for name, part in (("first", times[:11]), ("second", times[11:])):
        halves.append(out / name)
        write(out / name, [crazyflies(ns) for ns in part], packed=True)
    join(out / "split", halves)
    for half in halves:
        shutil.rmtree(half)
    static = transforms(transform(0, "base_link", "camera", 0.1, 0, 0.2))
    write(out / "robot", [(0, "/tf_static", static)] + [entry for ns in times for entry in robot(ns)])
    for name, every in (("robots", 500_000_000), ("robots_exact", 100_000_000)):
        write(out / name, [entry for ns in times for entry in robots(ns, ns % every == 0)])
    covariance = "geometry_msgs/msg/PoseWithCovarianceStamped"
    poses = [
        (ns, f"/r{k}/pose", make(covariance, header=header(ns, "map"), pose=covariant(k, ns / 1e9, 0)))
        for ns in times[:3]
        for k in (1, 2)
    ]
    write(out / "covariance", poses)


main(Path(sys.argv[1]))
