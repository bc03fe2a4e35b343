// CPU time of the line detectors on synthetic and real pictures, one thread, rounds that interleave all of
// them. runtime_lines [ROUNDS]
#include <fmt/format.h>
#include <sys/resource.h>

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <map>

#include "accuracy/line_scenes.h"

using namespace vss;
using namespace vss::bench;

namespace {

double CpuMs() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) * 1e3 + double(t.tv_nsec) * 1e-6;
}

double Median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + std::ptrdiff_t(v.size() / 2), v.end());
  return v[v.size() / 2];
}

void Compare(const std::string& name, const std::vector<GreyImage>& pictures, int rounds,
             const std::vector<Detector>& detectors) {
  if (pictures.empty()) return;
  std::vector<std::vector<double>> times(detectors.size());
  for (int r = 0; r <= rounds; ++r)
    for (std::size_t d = 0; d < detectors.size(); ++d) {
      const double start = CpuMs();
      for (const auto& p : pictures) detectors[d].find(p);
      if (r > 0) times[d].push_back((CpuMs() - start) / double(pictures.size()));  // the first round warms up
    }
  fmt::print("{:34}", name);
  const double lsd = Median(times[1]);
  for (std::size_t d = 0; d < detectors.size(); ++d)
    fmt::print("{:>10} {:8.2f} ms {:6.3f}", detectors[d].name, Median(times[d]), Median(times[d]) / lsd);
  fmt::print("\n");
}

std::vector<GreyImage> RealPictures() {
  std::vector<GreyImage> out;
  for (const char* survey : {"lab-1", "lab-2", "panel-3", "round-4", "yard-5"}) {
    const auto folder = std::filesystem::path(VSS_SOURCE_DIR) / "../shared/surveys" / survey / "images";
    if (!std::filesystem::exists(folder)) continue;
    std::vector<std::filesystem::path> files;
    for (const auto& f : std::filesystem::directory_iterator(folder)) files.push_back(f.path());
    std::sort(files.begin(), files.end());
    for (std::size_t i = 2; i < files.size(); i += 11)
      if (auto image = ReadImage(files[i])) out.push_back(std::move(*image));
  }
  return out;
}

// Steps and noise by simple arithmetic: as large as wanted, at once.
GreyImage LargePicture(int size) {
  GreyImage image(size, size, 8);
  unsigned state = 1;
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u) {
      state = state * 1664525u + 1013904223u;
      const unsigned noise = (state >> 24 & 7) + (state >> 20 & 7) + (state >> 16 & 7);
      image.Row8(v)[u] = static_cast<std::uint8_t>(60 + noise + ((u / 97 + v / 113) % 5 == 0 ? 60 : 0));
    }
  return image;
}

// Time and memory beside the picture, a pixel. Sizes must grow: memory is the process's largest so far.
void ShowGrowth(int size) {
  const GreyImage image = LargePicture(size);
  rusage before, after;
  getrusage(RUSAGE_SELF, &before);
  const double start = CpuMs(), pixels = double(size) * size;
  DetectLines(image.view(), nullptr, {});
  const double ms = CpuMs() - start;
  getrusage(RUSAGE_SELF, &after);
  fmt::print("{:5} x {:5}: {:5.1f} ns and {:5.2f} bytes a pixel (bar: 12 bytes)\n", size, size,
             1e6 * ms / pixels, 1024.0 * double(after.ru_maxrss - before.ru_maxrss) / pixels);
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 7;
  const auto detectors = Detectors();
  for (const int size : {1000, 2000, 4000, 8000, 20000}) ShowGrowth(size);
  fmt::print("CPU time a picture and its share of LSD's (bars: synthetic .10, real .17, 2048 x 2048 .10)\n");
  std::vector<GreyImage> synthetic;
  unsigned seed = 100;
  for (const Condition c :
       {Condition{20, 1, 1}, Condition{40, 2.5, 0.7}, Condition{80, 2.5, 1}, Condition{80, 5, 1.5}})
    synthetic.push_back(MakeScene(512, c, seed++).image);
  Compare("synthetic 512 x 512", synthetic, rounds, detectors);
  const auto real = RealPictures();
  if (real.empty()) fmt::print("SKIPPED real pictures: ../shared/surveys is not there\n");
  Compare("rendered surveys 512 x 512", real, rounds, detectors);
  std::vector<GreyImage> large;
  large.push_back(MakeScene(2048, {40, 2.5, 1}, seed).image);
  Compare("synthetic 2048 x 2048", large, std::max(1, rounds / 2), detectors);
}
