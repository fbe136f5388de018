"""The paper's figures of a run; `gallery` draws them.  Their names are here, for they are needed without matplotlib."""

#: Names of the figures of a run, in their order.
NAMES = ("load_curve", "orbit", "spectra", "phase_portrait", "ball_loads", "peak_moment", "shaft_loads")

#: Kinds of files of a moving picture.
MOVING = ("html", "mp4", "gif")

#: Kinds of files of a figure, and name of the page with the captions of a run's figures.
FORMATS = ("png", "svg", "pdf")
CAPTIONS = "figures.md"
