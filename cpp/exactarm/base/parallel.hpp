// Splits a batch of independent rows over threads: body(begin, end) on each block.
#pragma once

#include <algorithm>
#include <thread>
#include <vector>

namespace exactarm {

template <class Body>
void parallel_rows(long rows, int threads, long least_rows_a_thread, const Body& body) {
  const long wanted = std::min<long>(std::max(threads, 1), rows / std::max(least_rows_a_thread, 1L));
  const long blocks = std::max(wanted, 1L);
  std::vector<std::thread> workers;
  for (long block = 1; block < blocks; ++block)
    workers.emplace_back([&, block] { body(rows * block / blocks, rows * (block + 1) / blocks); });
  body(0L, rows / blocks);
  for (std::thread& worker : workers) worker.join();
}

}  // namespace exactarm
