"""Numbers by which a diagnosis decides in more than one place; each stands here once, with its reason."""

from __future__ import annotations

# probability from which a cause or an unknown function is named, and stays in a model: more likely than not
NAMED_AT = 0.5
# log Bayes factor of a cause, or of a richer form, over what it replaces: 150 to one; how many were tried is
# paid for beside it
LEAST_EVIDENCE = 5.0
LEAST_NATS = 3.0  # of a further term, or of another family of noise: twenty to one
CREDIBLE = 0.95  # of a set of causes that the data cannot part
DOUBT = 0.01  # of a rival that cannot be ruled out, and of a false alarm in a whole data set
CLEAR = 4.0  # standard deviations between two explanations that nobody confuses any more
CONFIRMED = 0.5  # share of the gain that the linear picture promises, which the fit must keep
WIDE = 3.0  # times its plausible size, what a rival may be when experiments are chosen
# share of a column's square sum left beside the declared parameters, below which these explain it
ABSORBED = 1e-6
INVISIBLE = 1e-3  # whitened length of a column at its plausible size, below which it is rounding
RIDGE = 1e-10  # of a column's square sum: columns that depend on each other, or show nowhere, have no size
RESPONDING = 1e-6  # of the strongest response, from which on a row, or a stretch of rows, responds at all
MANY_PARAMETERS = 200  # of a model: from here on a fit takes seconds, and one trial of a kind is made
