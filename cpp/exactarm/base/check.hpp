// Refusal of bad input: one exception type whose message names what was wrong,
// the value found and what was expected.
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

namespace exactarm {

class InvalidArgument : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

inline void require_size(const std::string& name, long found, long expected) {
  if (found != expected)
    throw InvalidArgument(name + ": size " + std::to_string(found) + ", expected " +
                          std::to_string(expected));
}

inline void require_finite(const std::string& name, double value) {
  if (!std::isfinite(value))
    throw InvalidArgument(name + ": expected a finite number, found " + std::to_string(value));
}

inline void require_positive(const std::string& name, double value) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw InvalidArgument(name + ": expected a positive number, found " + std::to_string(value));
}

}  // namespace exactarm
