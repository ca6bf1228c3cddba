"""A sink of your own: any object with ``write(frame)``. This one keeps the brightest pixel of every frame.

python examples/own_sink.py
"""

from dataclasses import dataclass, field

import flyaround as fa


@dataclass
class Brightest:
    """Highest digital number of each frame."""

    values: list[int] = field(default_factory=list)

    def write(self, frame: fa.Frame) -> None:
        """Take one frame."""
        self.values.append(int(frame.image.max()))


def main() -> None:
    """Write four frames into the sink."""
    plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), n=4, quality="draft")
    sink = Brightest()
    with fa.Renderer() as renderer:
        for _frame in fa.run_frames(plan, renderer, [sink], labels=False):
            pass
    print("brightest digital numbers:", sink.values)


if __name__ == "__main__":
    main()
