// Work on independent items with a given number of threads; the caller stores result i at place i, so that the
// outcome does not depend on the number of threads.
#pragma once
#include <cstddef>
#include <functional>

namespace vss {

// Calls body(i) for each i in [0, count), on at most `threads` threads (0: as many as the machine has).
void ParallelFor(std::size_t count, int threads, const std::function<void(std::size_t)>& body);

}  // namespace vss
