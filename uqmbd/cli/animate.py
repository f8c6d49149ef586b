"""`uqmbd animate`: the mechanism of a study in motion, with a cloud of realisations."""

from __future__ import annotations

from pathlib import Path

from uqmbd.errors import StudyError
from uqmbd.garbage_collection import loading
from uqmbd.propagation import load_study
from uqmbd.wording import format_duration

__all__ = ["animate_study"]

MOST_FRAMES = 3000


def animate_study(
    script: Path,
    *,
    out: Path | None = None,
    samples: int = 20,
    method: str | None = None,
    fps: float = 20.0,
    seconds: float | None = None,
) -> None:
    """Write an animation of a study.

    `script` is the study script. `out` is a ``.gif`` or ``.mp4`` file; the default is a GIF named like the script, in
    the current folder. `samples` is the number of realisations in addition to the means of the inputs. `method` is the
    label of the propagator with the displayed realisations. `fps` is the number of pictures per second. `seconds` is
    the duration of the animation; the default is the duration of the motion, but between 3 and 8 s.
    """
    from uqmbd.report import animate, motion
    from uqmbd.report.mechanisms import SECONDS, check_target

    target = Path(f"{script.stem}.gif") if out is None else out
    # the check comes before the computation
    check_target(target)
    with loading():
        study = load_study(script)
    length = float(study.times[-1] - study.times[0])
    lasting = min(max(length, SECONDS[0]), SECONDS[1]) if seconds is None else seconds
    if not (lasting > 0 and fps > 0):
        raise StudyError(f"--seconds {lasting:g} --fps {fps:g}: expected positive numbers.")
    frames = max(2, round(fps * lasting))
    if frames > MOST_FRAMES:
        raise StudyError(
            f"{frames} frames ({fps:g} per second for {lasting:g} s) are too many; expected at most {MOST_FRAMES}. "
            "Use a smaller --fps or --seconds."
        )
    data = motion(study, samples=samples, frames=frames, method=method)
    written = animate(data, target, seconds=lasting)
    shown = data.sizes["realisation"] - 1
    failed = int(data.attrs.get("failures", 0))
    factor = lasting / length
    speed = "real time" if abs(factor - 1) < 0.01 else f"{factor:.3g} times the duration of the motion"
    cloud = f"; motion at the means and {shown} realisations" if shown else "; motion at the means"
    lost = f" ({failed} failed and are not shown)" if failed else ""
    print(f"animation  {written}")
    print(f"{frames} frames in {format_duration(lasting, rough=True)}, {speed}{cloud}{lost}.")
