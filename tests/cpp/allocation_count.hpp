// Counts calls of operator new in this process, to show that evaluations allocate nothing. Sanitizers have an
// allocator of their own: under them nothing is counted, and a count of none shows nothing.
#pragma once

namespace exactarm::testing {

long allocation_count();
bool allocations_are_counted();

}  // namespace exactarm::testing
