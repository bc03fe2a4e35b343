// CPU time of the line detectors on synthetic and real pictures, one thread, rounds that interleave all of
// them. runtime_lines [ROUNDS]
#include <fmt/format.h>

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

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 7;
  const auto detectors = Detectors();
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
