// d/dt of samples by central differences of eighth order, block by block; toward the ends of a block the
// order falls to two. The differences of the values are divided by the same differences of the time stamps,
// so steps may vary a little.
#pragma once

#include <vector>

namespace exactarm {

// values, out (rows, columns) row by row; time (rows); starts: first row of each block, rising from 0.
void derivative(const double* values, const double* time, long rows, long columns,
                const std::vector<long>& starts, double* out);

}  // namespace exactarm
