"""Numbers by which a diagnosis decides in more than one place; each stands here once, with its reason."""

from __future__ import annotations

# probability from which a cause or an unknown function is named, and stays in a model: more likely than not
NAMED_AT = 0.5
# log Bayes factor of a cause, or of a richer form, over what it replaces: 150 to one; how many were tried is
# paid for beside it
LEAST_EVIDENCE = 5.0
LEAST_NATS = 3.0  # of a further term, or of another family of noise: twenty to one
# nats, 1 in 5e8: what is likelier by so much is certain, and the other counts for nothing in any probability
CERTAIN = 20.0
UNLIKELY = 0.05  # one in twenty: how often a clean data set may be said to hold something
CREDIBLE = 1.0 - UNLIKELY  # of a set of causes that the data cannot part; of what new poses should tell
DOUBT = 0.01  # of a rival that cannot be ruled out, and of a false alarm in a whole data set
REMOTE = 1e-3  # probability of a structure that chance does not explain, and of a rival that is worth no fit
CLEAR = 4.0  # standard deviations between two explanations that nobody confuses any more
SURE = 5.0  # standard deviations: one good number in two millions lies beyond
CONFIRMED = 0.5  # share of the gain that the linear picture promises, which the fit must keep
WIDE = 3.0  # times its plausible size, what a rival may be when experiments are chosen
# share of a column's square sum left beside the declared parameters, below which these explain it
ABSORBED = 1e-6
INVISIBLE = 1e-3  # whitened length of a column at its plausible size, below which it is rounding
RIDGE = 1e-10  # of a column's square sum: columns that depend on each other, or show nowhere, have no size
ROUNDING = 1e-6  # of a number: what differs by less is the same, written or computed again
RESPONDING = 1e-6  # of the strongest response, from which on a row, or a stretch of rows, responds at all
LOADED = 0.01  # of the largest torque (RMS): less does not count as load of an axis
FEW = 0.1  # of rows, or of groups of them, that may be wrong by themselves
ENOUGH_GROUPS = 5  # of rows, for each coefficient: the scatter of fewer is no estimate
LEVELS = 8  # different values of a signal: so few are taken each by itself; of more, as many bins are made
DRAWS = 400  # of a simulation: a probability to 2 %, two digits of a bit
DRAFTS = 3  # effects that one diagnosis writes, at most
MANY_PARAMETERS = 200  # of a model: from here on a fit takes seconds, and one trial of a kind is made
