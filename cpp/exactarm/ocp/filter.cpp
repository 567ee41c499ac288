#include "exactarm/ocp/filter.hpp"

#include <algorithm>

namespace exactarm::ocp {

bool Filter::accepts(const Merit& point) const {
  return std::all_of(points_.begin(), points_.end(), [&](const Merit& earlier) {
    return point.violation <= (1.0 - kMargin) * earlier.violation ||
           point.objective <= earlier.objective - kMargin * earlier.violation;
  });
}

}  // namespace exactarm::ocp
