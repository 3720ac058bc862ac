"""Uses datasets as LeRobot's users do, in LeRobot's Python, and prints one line of JSON with what it saw.

python -m tests.lerobot.parts.use_dataset load ROOT
python -m tests.lerobot.parts.use_dataset merge OUT ROOT ROOT
"""

import json
import sys
from pathlib import Path
from typing import Any

import torch
from lerobot.datasets.dataset_tools import merge_datasets
from lerobot.datasets.lerobot_dataset import LeRobotDataset

AHEAD = 3  # rows of the action
BATCH = 4
BACKEND = "pyav"  # torchcodec, its first choice, needs FFmpeg on the machine


def load(root: Path) -> dict[str, Any]:
    """All rows in batches, with pictures of two moments and actions of three."""
    plain = LeRobotDataset("tests/dataset", root=root, video_backend=BACKEND)
    step = 1 / plain.fps
    deltas = {"action": [k * step for k in range(AHEAD)]}
    deltas |= {key: [-step, 0.0] for key in plain.meta.camera_keys}
    dataset = LeRobotDataset("tests/dataset", root=root, delta_timestamps=deltas, video_backend=BACKEND)
    loader = torch.utils.data.DataLoader(dataset, batch_size=BATCH, num_workers=0)
    shapes: dict[str, list[int]] = {}
    events: list[int] = []
    for batch in loader:
        events += batch["lockstep.event"].tolist()
        shapes = shapes or {key: list(value.shape) for key, value in batch.items() if hasattr(value, "shape")}
    first = dataset[0]
    rows = [plain[number] for number in range(len(plain))]
    return {
        "state": [row["observation.state"].tolist() for row in rows],
        "action": [row["action"].tolist() for row in rows],
        "episode": [int(row["episode_index"]) for row in rows],
        "stamps": [row["lockstep.stamp"].reshape(-1).tolist() for row in rows],
        "drawn": [drawn(row, plain) for row in rows],
        "episodes": dataset.num_episodes,
        "frames": dataset.num_frames,
        "fps": dataset.fps,
        "events": events,
        "shapes": shapes,
        "names": {key: feature.get("names") for key, feature in dataset.features.items()},
        "task": first["task"],
        "driver": first["lockstep.driver"],
        "pads": first["action_is_pad"].tolist(),
        "stats": sorted(dataset.meta.stats["action"]),
        "padded_last": dataset[len(dataset) - 1]["action_is_pad"].tolist(),
    }


def drawn(row: dict[str, Any], dataset: LeRobotDataset) -> list[int]:
    """Return the event that the robot has drawn over the top of each picture: 31 bits in 32 cells (event_strip.py)."""
    found = []
    for key in dataset.meta.camera_keys:
        _, height, width = row[key].shape
        band = row[key][:, height // 80 : height // 20 - height // 80].mean(dim=(0, 1))
        cells = [band[i * width // 32 + width // 128 : (i + 1) * width // 32 - width // 128].mean() for i in range(31)]
        found.append(int("".join("1" if cell > 0.5 else "0" for cell in cells), 2))
    return found


def merge(out: Path, roots: list[Path]) -> dict[str, Any]:
    datasets = [
        LeRobotDataset(f"tests/part{number}", root=root, video_backend=BACKEND) for number, root in enumerate(roots)
    ]
    merge_datasets(datasets, "tests/merged", out)
    merged = LeRobotDataset("tests/merged", root=out, video_backend=BACKEND)
    return {
        "episodes": merged.num_episodes,
        "frames": merged.num_frames,
        "events": [int(merged[number]["lockstep.event"]) for number in range(len(merged))],
        "drawn": [drawn(merged[number], merged) for number in range(len(merged))],
        "drivers": sorted({merged[number]["lockstep.driver"] for number in range(len(merged))}),
    }


def count(roots: list[Path]) -> dict[str, Any]:
    """The events of all rows of each dataset, every row read with its pictures."""
    found = []
    for number, root in enumerate(roots):
        dataset = LeRobotDataset(f"tests/count{number}", root=root, video_backend=BACKEND)
        rows = [dataset[place] for place in range(len(dataset))]
        found.append([int(row["lockstep.event"]) for row in rows])
    return {"events": found}


if __name__ == "__main__":
    command, *paths = sys.argv[1:]
    given = [Path(path) for path in paths]
    if command == "load":
        print(json.dumps(load(*given)))
    else:
        print(json.dumps(count(given) if command == "count" else merge(given[0], given[1:])))
