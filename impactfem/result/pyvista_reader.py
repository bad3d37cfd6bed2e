"""A reader of pyvista that knows the time steps of VTKHDF files.

VTK reads them, but `pyvista.HDFReader` (up to 0.49 at least) passes on the first one only. This one
has the same methods as pyvista's other readers of files with times. pyvista finds it by the entry
point "pyvista.readers.override" of this package (from pyvista 0.49 on).
"""

from pyvista import HDFReader as _WithoutTimes
from pyvista import TimeReader


class HDFReader(_WithoutTimes, TimeReader):  # type: ignore[misc,unused-ignore]
    """Reads VTKHDF files step by step.

    Choose a step by `set_active_time_value` or `set_active_time_point`, then `read`.
    """

    @property
    def number_time_points(self) -> int:
        """Number of steps; 0 of a file without."""
        return len(self.time_values)

    @property
    def time_values(self) -> list[float]:
        """Times of all steps."""
        key = self.reader.GetExecutive().TIME_STEPS()
        about = self.reader.GetOutputInformation(0)
        return [float(about.Get(key, k)) for k in range(about.Length(key))]

    def time_point_value(self, time_point: int) -> float:
        """Time of a step."""
        return self.time_values[time_point]

    @property
    def active_time_value(self) -> float:
        """Time of the step that `read` reads."""
        return self.time_point_value(self.reader.GetStep())

    def set_active_time_value(self, time_value: float) -> None:
        """Let `read` read the step of a time.

        Raises:
            ValueError: No step has this time.
        """
        times = self.time_values
        if time_value not in times:
            raise ValueError(f"time {time_value} is none of {len(times)} steps; see time_values")
        self.set_active_time_point(times.index(time_value))

    def set_active_time_point(self, time_point: int) -> None:
        """Let `read` read a step, from 0 or from -1 backwards.

        Raises:
            IndexError: There is no such step.
        """
        self.reader.SetStep(range(self.number_time_points)[time_point])
