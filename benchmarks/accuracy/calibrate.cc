// Figures of the calibration, with OpenCV in the same run on the same marks:
//   1. the same optimum, hold-out, published values and time on public sets and on the rendered rig's marks;
//   2. simulation against the Cramer-Rao bound;
//   3. centres of discs;
//   4. the rendered rig against its truth.
// accuracy_calibrate [folder with calibration/ and surveys/; default ../shared beside the sources]
#include "vss/calibrate/calibrate.h"

#include <Eigen/Dense>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "vss/feature/marks_synthetic.h"

namespace fs = std::filesystem;
using namespace vss;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

BoardProblemOptions ProblemOf(LensModel model, int width, int height) {
  BoardProblemOptions p;
  p.model = model;
  p.terms = DefaultTerms(model);
  p.width_px = width, p.height_px = height;
  return p;
}

struct CvMarks {
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> img;
};

// OpenCV takes single precision: both get the marks rounded to it.
CvMarks ToCv(std::vector<BoardView>& views) {
  CvMarks m;
  for (BoardView& v : views) {
    m.board.emplace_back(), m.img.emplace_back();
    for (std::size_t i = 0; i < v.img.size(); ++i) {
      v.img[i] = v.img[i].cast<float>().cast<double>();
      v.point_in_board[i] = v.point_in_board[i].cast<float>().cast<double>();
      m.board.back().emplace_back(float(v.point_in_board[i].x()), float(v.point_in_board[i].y()), 0.f);
      m.img.back().emplace_back(float(v.img[i].x()), float(v.img[i].y()));
    }
  }
  return m;
}

struct CvLens {
  Intrinsics lens;
  double rms = 0, ms = 0;
};

CvLens CvCalibrate(const CvMarks& m, int width, int height, int repeats = 3) {
  CvLens out;
  out.ms = 1e9;
  for (int i = 0; i < repeats; ++i) {
    cv::Mat k, d;
    std::vector<cv::Mat> r, t;
    const auto start = std::chrono::steady_clock::now();
    out.rms = cv::calibrateCamera(m.board, m.img, {width, height}, k, d, r, t, cv::CALIB_FIX_K3);
    out.ms = std::min(
        out.ms, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    out.lens = {LensModel::kOpenCv,
                k.at<double>(0, 0),
                k.at<double>(1, 1),
                k.at<double>(0, 2),
                k.at<double>(1, 2),
                {d.at<double>(0), d.at<double>(1), d.at<double>(2), d.at<double>(3)},
                4,
                0};
  }
  return out;
}

BoardSolution AsSolution(const Intrinsics& lens) {
  BoardSolution s;
  s.intrinsics = lens;
  for (int i = 0; i < 4; ++i) s.term_values.push_back(lens.distortion[i]);
  return s;
}

std::vector<BoardView> Half(const std::vector<BoardView>& views, std::size_t rest) {
  std::vector<BoardView> half;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (i % 2 == rest) half.push_back(views[i]);
  return half;
}

std::vector<double> ratios;

void CompareOn(const char* name, std::vector<BoardView> views, int width, int height) {
  const CvMarks marks = ToCv(views);
  const CvLens cv = CvCalibrate(marks, width, height);
  const auto problem = ProblemOf(LensModel::kOpenCv, width, height),
             weng = ProblemOf(LensModel::kWeng, width, height);
  double ms = 1e9;
  Result<BoardSolution> ours = InputError("not run");
  for (int i = 0; i < 5; ++i) {
    const auto start = std::chrono::steady_clock::now();
    ours = SolveBoards(views, problem);
    ms = std::min(
        ms, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  if (!ours) {
    std::printf("%-12s FAILED: %s\n", name, ours.error().message.c_str());
    return;
  }
  auto odd = Half(views, 0), even = Half(views, 1);
  const auto half = SolveBoards(odd, weng);
  const double holdout = half ? SolveBoardPoses(even, weng, *half)->rms_px : -1;
  const CvLens cv_half = CvCalibrate(ToCv(odd), width, height, 1);
  const double cv_holdout = SolveBoardPoses(even, problem, AsSolution(cv_half.lens))->rms_px;
  ratios.push_back(cv.ms / ms);
  std::printf(
      "%-12s RMS ours %.6f OpenCV %.6f (diff %+.1e)  hold-out ours (weng) %.4f OpenCV %.4f  f %.2f %.2f c "
      "%.2f %.2f (OpenCV f %.2f %.2f)  time %.2f ms against %.1f ms: 1/%.1f\n",
      name, ours->rms_px, cv.rms, ours->rms_px - cv.rms, holdout, cv_holdout, ours->intrinsics.fx_px,
      ours->intrinsics.fy_px, ours->intrinsics.cx_px, ours->intrinsics.cy_px, cv.lens.fx_px, cv.lens.fy_px,
      ms, cv.ms, cv.ms / ms);
}

std::vector<BoardView> ViewsOf(const std::vector<fs::path>& files, const TargetSpec& target, int& width,
                               int& height) {
  std::vector<BoardView> views;
  for (const auto& f : files) {
    const auto image = ReadImage(f);
    if (!image) continue;
    width = image->width(), height = image->height();
    const auto board = FindMarks(image->view(), target);
    if (!board) continue;
    BoardView v;
    for (const Mark& m : board->marks)
      v.point_in_board.push_back(target.PointOnBoard(m.column, m.row)), v.img.push_back(m.img);
    views.push_back(v);
  }
  return views;
}

std::vector<fs::path> Files(const fs::path& folder, const std::string& start) {
  std::vector<fs::path> files;
  for (const auto& e : fs::directory_iterator(folder))
    if (e.path().filename().string().rfind(start, 0) == 0) files.push_back(e.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<BoardView> Zhang(const fs::path& folder) {
  const auto read = [](const fs::path& f) {
    std::ifstream in(f);
    std::vector<Vector2d> p;
    for (double x, y; in >> x >> y;) p.emplace_back(x, y);
    return p;
  };
  auto model = read(folder / "Model.txt");
  for (auto& p : model) p.y() = -p.y();  // y down, as seen
  std::vector<BoardView> views;
  for (int i = 1; i <= 5; ++i) views.push_back({model, read(folder / fmt::format("data{}.txt", i)), false});
  return views;
}

void Simulate() {
  const Intrinsics truth{LensModel::kOpenCv, 1000, 1000, 255.5, 255.5, {-0.2, 0.1, 5e-4, -5e-4}, 4, 0};
  const auto problem = ProblemOf(LensModel::kOpenCv, 512, 512);
  std::vector<BoardView> exact;
  for (int v = 0; v < 10; ++v) {
    const double axis = 2 * kPi * v / 10 * 3, tilt = RadFromDeg(30);
    const Eigen::Matrix3d r = RotationFromVector(tilt * Vector3d(std::cos(axis), std::sin(axis), 0)) *
                              RotationFromVector(0.6 * v * Vector3d::UnitZ());
    const RigidTransform pose{r, Vector3d(8 * std::cos(2.0 * v), 8 * std::sin(3.0 * v), 500 + 10 * (v % 3)) -
                                     r * Vector3d(100, 100, 0)};
    BoardView view;
    for (int i = 0; i < 121; ++i) {
      const Vector2d p(20.0 * (i % 11), 20.0 * (i / 11));
      const auto img = truth.Project(pose * Vector3d(p.x(), p.y(), 0));
      if (img && img->minCoeff() > 0 && img->maxCoeff() < 511)
        view.point_in_board.push_back(p), view.img.push_back(*img);
    }
    exact.push_back(view);
  }
  for (double sigma : {0.02, 0.05, 0.1}) {
    constexpr int kTrials = 200;
    Eigen::MatrixXd squared = Eigen::MatrixXd::Zero(8, 1), bound = squared;
    double nees = 0, covered = 0;
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, sigma);
    for (int trial = 0; trial < kTrials; ++trial) {
      auto views = exact;
      for (auto& v : views)
        for (auto& p : v.img) p += Vector2d(noise(random), noise(random));
      const auto s = SolveBoards(views, problem);
      if (!s) continue;
      const auto& k = s->intrinsics;
      Eigen::VectorXd e(8);
      e << k.fx_px - 1000, k.fy_px - 1000, k.cx_px - 255.5, k.cy_px - 255.5, k.distortion[0] + 0.2,
          k.distortion[1] - 0.1, k.distortion[2] - 5e-4, k.distortion[3] + 5e-4;
      squared += e.cwiseAbs2() / kTrials;
      bound += s->covariance.diagonal() * (sigma * sigma / (s->sigma_px * s->sigma_px)) / kTrials;
      nees += e.dot(s->covariance.ldlt().solve(e)) / 8 / kTrials;
      for (int i = 0; i < 8; ++i)
        covered += (std::abs(e[i]) < 1.96 * std::sqrt(s->covariance(i, i))) / (8.0 * kTrials);
    }
    std::printf(
        "noise %.2f px: normalised squared error %.3f, 95 %% intervals cover %.1f %%, RMS over Cramer-Rao",
        sigma, nees, 100 * covered);
    for (int i = 0; i < 8; ++i) std::printf(" %.2f", std::sqrt(squared(i) / bound(i)));
    std::printf(" (fx fy cx cy k1 k2 p1 p2)\n");
  }
}

void DiscCentres() {
  synthetic::Scene s;
  s.width_px = s.height_px = 512;
  s.lens = {LensModel::kPinhole, 1000, 1000, 255.5, 255.5, {}, 0, 0};
  s.blur_px = 0.7, s.noise_levels = 2.8, s.subsamples = 8;
  TargetSpec t;
  t.columns = 11, t.rows = 9, t.pitch_mm = 28, t.diameter_mm = 14;
  double all = 0, all_cv = 0, n = 0, n_cv = 0;
  for (double tilt_deg : {0.0, 15.0, 30.0, 45.0}) {
    const RigidTransform pose = synthetic::BoardPose(t, 1000, RadFromDeg(tilt_deg), 0.6, 0.1);
    s.seed = 11 + static_cast<unsigned>(tilt_deg);
    const GreyImage image = synthetic::Render(s, t, pose);
    const auto board = FindMarks(image.view(), t);
    if (!board) continue;
    double sum = 0;
    for (const Mark& m : board->marks) {
      const Vector2d p = t.PointOnBoard(m.column, m.row);
      sum += (m.img - DiscEccentricity(s.lens, pose, p, 0.5 * t.diameter_mm) -
              *s.lens.Project(pose * Vector3d(p.x(), p.y(), 0)))
                 .squaredNorm();
    }
    all += sum, n += 2.0 * board->marks.size();
    cv::Mat grey(512, 512, CV_8U);
    for (int v = 0; v < 512; ++v)
      for (int u = 0; u < 512; ++u)
        grey.at<unsigned char>(v, u) = static_cast<unsigned char>(image.view().At(u, v) / 257);
    std::vector<cv::Point2f> found;
    double sum_cv = 0;
    const bool ok = cv::findCirclesGrid(grey, {t.columns, t.rows}, found);
    for (const auto& f : found) {
      double best = 1e9;
      for (int r = 0; r < t.rows; ++r)
        for (int c = 0; c < t.columns; ++c)
          best = std::min(
              best, (Vector2d(f.x, f.y) - *s.lens.Project(pose * Vector3d(c * t.pitch_mm, r * t.pitch_mm, 0)))
                        .squaredNorm());
      sum_cv += best;
    }
    if (ok) all_cv += sum_cv, n_cv += 2.0 * found.size();
    std::printf("tilt %2.0f: %zu discs, %.4f px RMS a coordinate; OpenCV findCirclesGrid %s\n", tilt_deg,
                board->marks.size(), std::sqrt(sum / (2 * board->marks.size())),
                ok ? fmt::format("{:.4f}", std::sqrt(sum_cv / (2 * found.size()))).c_str() : "none");
  }
  std::printf("all tilts: %.4f px RMS; OpenCV %.4f\n", std::sqrt(all / n),
              n_cv > 0 ? std::sqrt(all_cv / n_cv) : 0);
}

// OpenCV's own way: whole boards only, findCirclesGrid or findChessboardCorners with cornerSubPix.
std::optional<Intrinsics> CvFromPictures(const fs::path& folder, bool discs, int& used) {
  CvMarks m;
  const cv::Size size = discs ? cv::Size(13, 11) : cv::Size(12, 9);
  for (const auto& f : Files(folder, "")) {
    const cv::Mat grey = cv::imread(f.string(), cv::IMREAD_GRAYSCALE);
    std::vector<cv::Point2f> found;
    const bool ok =
        discs ? cv::findCirclesGrid(grey, size, found) : cv::findChessboardCorners(grey, size, found);
    if (!ok) continue;
    if (!discs) cv::cornerSubPix(grey, found, {5, 5}, {-1, -1}, cv::TermCriteria(3, 100, 1e-4));
    m.img.push_back(found);
    m.board.emplace_back();
    for (int i = 0; i < size.area(); ++i)
      m.board.back().emplace_back(70.f * (i % size.width), 70.f * (i / size.width), 0.f);
  }
  used = static_cast<int>(m.img.size());
  if (used < 2) return std::nullopt;
  return CvCalibrate(m, 512, 512, 1).lens;
}

void Rig(const fs::path& rig) {
  const auto truth = nlohmann::json::parse(std::ifstream(rig / "truth.json"));
  const auto job = ReadCalibrationJob(rig);
  if (!job) return;
  for (bool opencv : {false, true}) {
    CalibrationOptions options;
    options.opencv = opencv;
    const auto calibration = Calibrate(*job, options, 2, {});
    if (!calibration) {
      std::printf("%s\n", calibration.error().message.c_str());
      continue;
    }
    for (const auto& c : calibration->cameras)
      for (const auto& t : truth["cube"]["cameras"]) {
        if (t["id"] != c.camera.id) continue;
        const auto& l = t["lens"];
        const Intrinsics lens{LensModel::kOpenCv,
                              t["fx"],
                              t["fy"],
                              t["cx"],
                              t["cy"],
                              {l["k1"], l["k2"], l["p1"], l["p2"], l["k3"]},
                              5,
                              0};
        RigidTransform pose;
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) pose.rotation(i, j) = t["r"][i][j];
          pose.translation[i] = t["t"][i];
        }
        double sum = 0;
        for (int j = 0; j < 16; ++j)
          for (int i = 0; i < 16; ++i) {
            const Vector2d p(511.0 * i / 15, 511.0 * j / 15);
            sum += (pose.rotation.transpose() * *lens.Unproject(p) -
                    c.camera.cam_from_world->rotation.transpose() * *c.camera.intrinsics.Unproject(p))
                       .squaredNorm() /
                   256;
          }
        std::printf(
            "%s as %s: %zu of %zu views, map %.4f px RMS (bar 0.05), centre %.3f mm (0.5), rays %.4f mrad "
            "RMS (0.2)",
            c.camera.id.c_str(), opencv ? "opencv" : "weng", c.lens->views.size(), c.lens->quality.size(),
            LensDifference(lens, c.camera.intrinsics, 512, 512).rms,
            (c.camera.cam_from_world->Inverse().translation - pose.Inverse().translation).norm(),
            1e3 * std::sqrt(sum));
        if (opencv) {
          int used = 0;
          const auto cv =
              CvFromPictures(rig / ("board_" + c.camera.id), c.target.pattern == TargetPattern::kDiscs, used);
          std::printf("; OpenCV %d views, map %s px", used,
                      cv ? fmt::format("{:.4f}", LensDifference(lens, *cv, 512, 512).rms).c_str() : "none");
        }
        std::printf("\n");
      }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const fs::path shared = argc > 1 ? fs::path(argv[1]) : fs::path(VSS_SOURCE_DIR) / "../shared";
  std::printf("-- Public sets and the rig's marks: optimum, hold-out, time\n");
  if (const fs::path pub = shared / "calibration/public"; fs::exists(pub)) {
    TargetSpec board;
    board.pattern = TargetPattern::kCheckerboard, board.columns = 9, board.rows = 6, board.pitch_mm = 25;
    int w = 640, h = 480;
    for (const char* side : {"left", "right"})
      CompareOn(side, ViewsOf(Files(pub / "opencv-left-right", side), board, w, h), w, h);
    CompareOn("zhang", Zhang(pub / "zhang"), 640, 480);
    std::printf("published: left 533.00 533.15; zhang 832.50 832.53 303.96 206.59\n");
  } else {
    std::printf("NOT MEASURED: %s is not there\n", pub.c_str());
  }
  const fs::path rig = shared / "calibration/rig-1";
  if (const auto job = ReadCalibrationJob(rig)) {
    for (const auto& lens : job->intrinsic) {
      std::vector<fs::path> files;
      for (const auto& f : lens.images) files.push_back(f.path);
      int w = 0, h = 0;
      auto views = ViewsOf(files, lens.target, w, h);
      CompareOn(lens.camera.c_str(), views, w, h);
    }
  }
  if (!ratios.empty()) {
    std::sort(ratios.begin(), ratios.end());
    std::printf("time against OpenCV: worst 1/%.1f (bar 1/4), median 1/%.1f (bar 1/8)\n", ratios.front(),
                ratios[ratios.size() / 2]);
  }
  std::printf("-- Simulation, 200 trials each (bars: 0.9 to 1.1; 92 to 98 %%; 1.15)\n");
  Simulate();
  std::printf("-- Disc centres, 14 px discs, blur 0.7 px, noise 1.1 %% (bar 0.01)\n");
  DiscCentres();
  std::printf("-- Rendered rig against its truth\n");
  if (fs::exists(rig / "truth.json"))
    Rig(rig);
  else
    std::printf("NOT MEASURED: %s is not there\n", rig.c_str());
}
