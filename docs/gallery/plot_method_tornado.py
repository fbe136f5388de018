"""
Which number matters most
=========================

Derivatives of the highest ball force by eight numbers of the scene, all from one run,
each checked by a second route.
"""

# %%
# "% per %" says by how many per cent the force changes when the number grows by one.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
names = [
    "mechanism.forces.punch.force.y",
    "bearing.contact.inner_groove_radius",
    "bearing.contact.outer_groove_radius",
    "bearing.clearance",
    "bearing.share",
    "mechanism.driver.speed",
    "mechanism.bodies.slider.mass",
    "mechanism.bodies.crank.points.B",
]
report = model.sensitivity("peak_ball_force", names)
for pair in report.of("peak_ball_force"):
    verdict = pair.check.verdict.value
    print(f"{pair.parameter:36} {pair.dimensionless:+.4f} % per %  {verdict}")

# %%
# Ranked as a tornado chart. Bars to the left are numbers that lower the force as they
# grow.
ranked = list(reversed(report.of("peak_ball_force")))
figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
words = [report.words[pair.parameter] for pair in ranked]
axes.barh(words, [pair.dimensionless for pair in ranked])
axes.axvline(0, color="black", linewidth=0.8)
axes.set(
    xlabel="change of the highest ball force [% for 1 %]",
    title="Sensitivities of the peak ball force",
)
plt.show()
