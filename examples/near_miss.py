"""Writes a recording of four vehicles at 5 Hz. Two of them pass each other between two samples.

Usage: ``python examples/near_miss.py > examples/near-miss.csv``.

``a`` and ``b`` fly through the origin at right angles, 12 cm apart in height. All samples show them at least 0.57 m
apart. Between two samples they are 0.12 m apart.
"""

SPEED_M_S = 4.0
RATE_HZ = 5
SAMPLES = 12
CROSSING_S = 1.1


def positions_m(t_s: float) -> dict[str, tuple[float, float, float]]:
    """Returns the position of each vehicle."""
    along = SPEED_M_S * (t_s - CROSSING_S)
    return {
        "a": (along, 0.0, 2.0),
        "b": (0.0, along, 2.12),
        "c": (along, 3.0, 2.0),
        "d": (3.0, -along, 2.0),
    }


def main() -> None:
    print("time_s,id,x,y,z")
    for k in range(SAMPLES):
        t_s = k / RATE_HZ
        for name, (x, y, z) in positions_m(t_s).items():
            print(f"{t_s:.1f},{name},{x:.2f},{y:.2f},{z:.2f}")


if __name__ == "__main__":
    main()
