"""
Fit parameters with JAX
=======================

How large are the clearance of the press's bearing and the damping of its balls, if only
the motion of the inner ring was measured? An optimiser of JAX finds them with the
derivatives of the simulation.
"""

# %%
# JAX has to compute in 64 bits, which is set before its first array.
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import optax

import ballpass.jax
from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import QuantityFunction, load

jax.config.update("jax_enable_x64", True)
model = load(generate(shipped_scenes()["press"]))

# %%
# A measured signal is a quantity for each sample: the ring's place at 72 crank angles
# of a turn.
angles = np.arange(2.0, 360.0, 5.0)
signal = QuantityFunction(
    model,
    of=[f"value:inner.y@{angle}deg" for angle in angles],
    wrt=["bearing.clearance", "bearing.damping.ratio"],
    cycles=1,
    transient=0,
)

# %%
# No machine is at hand: the measurement is a simulation with other parameters, and with
# noise of 0.2 µm.
true = np.array([1.4, 0.7]) * signal.start
noise = 0.2e-6 * np.random.default_rng(1).standard_normal(len(angles))
measured = signal(true) + noise

# %%
# The unknowns are multiples of the scene's numbers, so that both are about one; as
# logarithms they stay positive.
simulated = ballpass.jax.wrap(signal)


@jax.jit
@jax.value_and_grad
def misfit(logarithms):
    difference = simulated(signal.start * jnp.exp(logarithms)) - measured
    return jnp.mean((difference / 1e-6) ** 2)  # [µm²]


# %%
# The optimiser is Adam of optax, with steps that get shorter.
optimiser = optax.adam(optax.cosine_decay_schedule(0.1, 60))
logarithms = jnp.zeros(2)
state, history = optimiser.init(logarithms), []
for _ in range(60):
    value, slope = misfit(logarithms)
    step, state = optimiser.update(slope, state)
    logarithms = optax.apply_updates(logarithms, step)
    history.append(float(value))

found = signal.start * np.exp(logarithms)
for name, fitted, given in zip(signal.wrt, found, true, strict=True):
    print(f"{name}: {fitted / given:.3f} of the true value")

# %%
# What is left of the misfit is the noise.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.semilogy(history)
left.set(xlabel="step", ylabel="mean square misfit [µm²]")
right.plot(angles, 1e6 * measured, ".", label="measured")
right.plot(angles, 1e6 * signal(signal.start), "--", label="scene")
right.plot(angles, 1e6 * signal(found), label="fitted")
right.set(xlabel="crank angle [°]", ylabel="inner ring, y [µm]")
right.legend()
plt.show()
