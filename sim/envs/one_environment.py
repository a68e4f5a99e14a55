"""Methods of a stable-baselines3 VecEnv that are the same for all worlds, because the worlds share one environment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

import numpy as np
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import tile_images

from sim.envs.calls import seed_of


class OneEnvironment(VecEnv):
    """Worlds that share one environment, and therefore its attributes and methods."""

    def __reduce__(self) -> NoReturn:
        """Refuse to be pickled or copied."""
        raise TypeError(
            f"{type(self).__name__} cannot be pickled or copied, since it contains compiled kernels and physics; "
            "build one in every process that needs it"
        )

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed all random streams at the next reset, and return a list that contains `seed` num_envs times.

        World i uses streams derived from (seed, i). If the seed is None, the random numbers continue.

        Raises:
            ValueError: the seed is neither a whole number of at least 0 nor None.
        """
        self._seeds = [seed_of("seed", seed)] * self.num_envs
        return self._seeds

    def render(self, mode: str | None = None) -> np.ndarray | None:
        """Return the images of all worlds, tiled; None without a render mode, or if `mode` differs from it.

        Stable-baselines3 forwards unsupported modes to the individual environments. Here all worlds share this
        environment, so it handles the mode "eyes" itself.

        Raises:
            RuntimeError: there is a render mode, and there has been no reset yet, `close` has been called, or an action
                is pending.
        """
        if self.render_mode == "eyes" and mode in (None, "eyes"):
            return tile_images(self.get_images())
        return super().render(mode)

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Set an attribute of the environment; ValueError unless `indices` selects all worlds."""
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError("set_attr: the worlds share one environment; set an attribute for all of them")
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: int | Iterable[int] | None = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment once; ValueError unless `indices` selects all worlds."""
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError("env_method: the worlds share one environment; call a method for all of them")
        result = getattr(self, method_name)(*args, **kwargs)
        return [result] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]
