"""The environment: the checker of Gymnasium, determinism, rewards."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import trepan
from trepan.gym import DrillEnv


def episode(env: DrillEnv, seed: int, down: float) -> tuple[list[np.ndarray], float, dict[str, float]]:
    seen, info = env.reset(seed=seed)
    observations, sum_of_rewards, is_over = [seen], 0.0, False
    while not is_over:
        action = np.array([0.2 * np.sin(len(observations)), 0.1 * (-1) ** len(observations), down], np.float32)
        seen, reward, terminated, truncated, info = env.step(action)
        observations.append(seen)
        sum_of_rewards += reward
        is_over = terminated or truncated
    return observations, sum_of_rewards, info


def test_gymnasium_finds_no_fault() -> None:
    check_env(DrillEnv(), skip_render_check=True)


def test_a_seed_gives_the_same_episode() -> None:
    first, second, other = (episode(DrillEnv(), seed, 0.2)[0] for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, second)
    assert len(other) != len(first) or (np.array(other) != np.array(first)).any()


def test_a_careful_hand_gets_more_and_plunges_less() -> None:
    env = DrillEnv()
    _, careful, at_end = episode(env, 1, 0.12)
    _, hasty, of_hasty = episode(env, 1, 1.0)
    assert careful > hasty and at_end["plunge_mm"] < of_hasty["plunge_mm"]
    assert at_end["removed_mm3"] > 30


def test_a_skull_is_drilled_too() -> None:
    ct, _ = trepan.scenes.head(2.0)
    env = DrillEnv(ct, steps=30)
    seen, info = env.reset(seed=2)
    assert env.observation_space.contains(seen) and 3 < info["thickness_mm"] < 9
    assert env.step(np.array([0, 0, 1], np.float32))[3] is False
    assert [env.step(np.zeros(3, np.float32))[3] for _ in range(29)][-1] is True


def test_wrong_input_is_an_exception() -> None:
    with pytest.raises(ValueError, match="burr_radius_mm is 0"):
        DrillEnv(burr_radius_mm=0)
    env = DrillEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="three finite numbers"):
        env.step(np.array([0, 0, np.nan], np.float32))
