"""Drilling as a Gymnasium environment (needs gymnasium)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import scenes
from ._trepan import AIR_HU, BoneVolume, RigidContact, Tool
from .bone import first_bone
from .images import VoxelVolume, bone_isovalue, hounsfield, resample

try:
    import gymnasium
except ImportError:
    raise ImportError("trepan.gym needs Gymnasium: pip install gymnasium") from None

# Ticks of 1 ms in a step of the environment: the hand of a policy at 100 Hz.
_TICKS = 10
# Steps after the breakthrough in which the hand may still plunge or pull back: 200 ms.
_AFTER = 20
# Sides of the local map of bone, points.
_MAP = 5
# Bounds of the observation: tip, force, bone removed, plunge, breakthrough, spindle, map.
_BOUNDS = np.array([100.0] * 3 + [1000.0] * 3 + [1e5, 100.0, 1.0, 1000.0] + [1.0] * _MAP**2, np.float32)


class DrillEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Drill a hole through bone without plunging into what lies behind it.

    The burr starts 2 mm over the bone. An **action** of shape (3,) in -1 to 1 is its velocity, in
    units of ``speed_mm_s``, along two axes in the surface and along the axis into the bone; the
    burr turns all the time. A step lasts 10 ms, ten ticks of the haptic loop.

    An **observation** of shape (35,), float32: tip from the entry along the three axes, mm; force
    on the tip along them, N; bone removed, mm3; depth of the burr behind the inner table, mm; 1
    after the breakthrough, else 0; speed of the spindle, 1000/min; and a map of 5 x 5 points across
    the burr, 1 mm apart, 1 where there is bone at the height of the burr's front.

    The **reward** is the progress of the burr to the inner table, mm, less 0.01 a step, less 0.02
    for each newton over 20 N. 200 ms after the breakthrough an episode ends with +10 less 2
    for each millimetre of the deepest plunge behind the table; 30 mm off the entry ends it as well,
    and it is truncated after ``steps``.

    ``reset(seed=...)`` chooses the entry: a flat bone of 4 to 8 mm with its density, or, with a
    ``ct`` (HU on any grid), a point on the top of that skull. The same seed and actions give the same
    observations, bit for bit. ``info`` has ``force_n``, ``plunge_mm``, ``removed_mm3``.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        ct: VoxelVolume | None = None,
        *,
        burr_radius_mm: float = 2.0,
        speed_mm_s: float = 20.0,
        steps: int = 2000,
    ) -> None:
        for name, number in (("burr_radius_mm", burr_radius_mm), ("speed_mm_s", speed_mm_s), ("steps", steps)):
            if not (np.isfinite(number) and number > 0):
                raise ValueError(f"{name} is {number}: it must be over 0 and finite")
        self.render_mode = None
        self._ct = None if ct is None else resample(hounsfield(ct), 1.0, "cubic", AIR_HU)
        self._isovalue = 400 if self._ct is None else bone_isovalue(self._ct)
        self._burr = Tool.burr(burr_radius_mm)
        self._speed, self._most_steps = speed_mm_s, steps
        self.observation_space = gymnasium.spaces.Box(-_BOUNDS, _BOUNDS, dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        side = np.arange(_MAP) - _MAP // 2
        self._map = np.stack([*np.meshgrid(side, side), np.zeros((_MAP, _MAP))], axis=-1).reshape(-1, 3)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start at an entry chosen by the seed; ``options`` are not used."""
        super().reset(seed=seed)
        if self._ct is None:
            thickness, hu = self.np_random.uniform([4.0, 900.0], [8.0, 1500.0])
            self._bone = BoneVolume(scenes.slab(thickness, hu=hu), self._isovalue)
            self._entry, self._thickness = np.zeros(3), float(thickness)
        else:
            self._bone = BoneVolume(self._ct, self._isovalue)
            self._entry, self._thickness = self._place(self._bone)
        self._contact = RigidContact(self._bone, self._burr)
        self._tip = self._entry + [0.0, 0.0, self._burr.tip_radius_mm + 2.0]
        self._contact.reset(self._tip)
        self._proxy, self._force = self._tip, np.zeros(3)
        self._removed, self._rpm, self._deepest, self._step = 0.0, 0.0, 0.0, 0
        self._through_at: int | None = None
        return self._observe(), self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Move for 10 ms; see the class for actions, observations and rewards."""
        way = np.clip(np.asarray(action, np.float64), -1.0, 1.0) * [1.0, 1.0, -1.0]
        if way.shape != (3,) or not np.isfinite(way).all():
            raise ValueError(f"action is {action}: it must be three finite numbers from -1 to 1")
        ticks = np.arange(1, _TICKS + 1)[:, None] * (1e-3 * self._speed * way)
        path = self._contact.path(self._tip + ticks, drilling=True)
        before = self._way_left()
        self._tip = self._tip + ticks[-1]
        self._proxy = path.proxy_mm[-1].astype(np.float64)
        self._force = self._contact.stiffness_n_per_mm * float(path.depth_mm[-1]) * path.normal[-1]
        self._removed += float(path.removed_mm3.sum())
        self._rpm = float(path.spindle_rpm[-1])
        self._deepest = max(self._deepest, self._plunge())
        self._step += 1
        if self._through_at is None and path.broke_through.any():
            self._through_at = self._step
        is_done = self._through_at is not None and self._step >= self._through_at + _AFTER
        reward = before - self._way_left() - 0.01 - 0.02 * max(0.0, float(np.linalg.norm(self._force)) - 20.0)
        if is_done:
            reward += 10.0 - 2.0 * self._deepest
        is_lost = bool(np.linalg.norm(self._tip - self._entry) > 30.0)
        is_late = self._step >= self._most_steps
        return self._observe(), float(reward), is_done or is_lost, is_late, self._info()

    def _place(self, bone: BoneVolume) -> tuple[NDArray[np.float64], float]:
        """An entry on the top of a skull, and its thickness downwards, mm."""
        low, high = np.array(bone.bounds_mm)
        middle, reach = 0.5 * (low + high), 0.2 * (high - low)
        for _ in range(100):
            x, y = self.np_random.uniform(middle[:2] - reach[:2], middle[:2] + reach[:2])
            entry = first_bone(bone, (x, y, high[2] + 1.0), (x, y, middle[2]))
            if entry is not None:
                below = entry - np.arange(0.0, 20.0, 0.1)[:, None] * [0.0, 0.0, 1.0]
                outside = ~bone.is_bone(below)
                if outside.any() and 2.0 < 0.1 * outside.argmax():
                    return entry, float(0.1 * outside.argmax())
        raise ValueError("no bone of 2 to 20 mm was found on the top of the CT: is it a head in RAS?")

    def _way_left(self) -> float:
        """Way of the burr's front to the inner table, mm; 0 behind it."""
        front = self._proxy[2] - self._burr.tip_radius_mm
        return float(max(0.0, front - (self._entry[2] - self._thickness)))

    def _plunge(self) -> float:
        """How far the burr reaches behind the inner table, mm."""
        inner = self._entry[2] - self._thickness
        return float(max(0.0, inner - (self._proxy[2] - self._burr.tip_radius_mm)))

    def _observe(self) -> NDArray[np.float32]:
        front = self._proxy - [0.0, 0.0, self._burr.tip_radius_mm]
        bone = self._bone.is_bone(front + self._map)
        numbers = [self._removed, self._plunge(), float(self._through_at is not None), 1e-3 * self._rpm]
        parts = (self._tip - self._entry, self._force, numbers, bone)
        return np.clip(np.concatenate(parts).astype(np.float32), -_BOUNDS, _BOUNDS)

    def _info(self) -> dict[str, Any]:
        return {
            "force_n": float(np.linalg.norm(self._force)),
            "plunge_mm": self._deepest,
            "removed_mm3": self._removed,
            "thickness_mm": self._thickness,
        }
