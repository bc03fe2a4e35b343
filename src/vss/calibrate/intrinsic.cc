#include "vss/calibrate/intrinsic.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "vss/base/median.h"
#include "vss/calibrate/maps.h"
#include "vss/solve/schur_lm.h"

namespace vss {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMinViews = 3;        // fewer leave the lens undetermined (Zhang 2000, section 3.1)
constexpr int kMinMarksInView = 8;  // 16 numbers for the 6 of a pose
constexpr double kMinDropPx =
    0.1;  // no lens model is sure to be exact below, so nothing nearer is called wrong
constexpr double kMaxDropShare = 0.2;     // of a view's marks: beyond, the view is wrong, not its marks
constexpr double kBlurRatio = 1.6;        // of the median blur: beyond, the view is called blurred
constexpr double kSizeTolerance = 0.12;   // diameter over pitch as seen against as given
constexpr double kAspectTolerance = 0.1;  // fy/fx against the data sheet's pixel pitch

std::string MarksName(const TargetSpec& t) {
  return t.pattern == TargetPattern::kDiscs ? "discs" : "corners";
}

// ---- What can be said before anything is solved ----

Status CheckSizes(const std::string& camera, const std::vector<BoardPicture>& pictures) {
  for (const BoardPicture& p : pictures)
    if (p.width_px != pictures[0].width_px || p.height_px != pictures[0].height_px)
      return InputError(
          "camera {}: {} has {} x {} px, but {} has {} x {}; pictures of one calibration come from one "
          "camera at one setting, so take the odd ones out",
          camera, p.file, p.width_px, p.height_px, pictures[0].file, pictures[0].width_px,
          pictures[0].height_px);
  return {};
}

Status CheckCounts(const std::string& camera, const TargetSpec& target, std::vector<BoardPicture>& pictures) {
  std::map<std::pair<int, int>, int> wrong;
  int usable = 0, mirrored = 0, other_codes = 0, telling = 0;
  for (BoardPicture& p : pictures) {
    if (!p.why_unusable.empty()) continue;
    ++usable;
    const BoardMarks& b = p.board;
    mirrored += b.mirrored, other_codes += b.codes_disagree;
    if (b.codes_disagree) p.why_unusable = "its markers are not where the target has them";
    const bool too_many = b.columns_seen > target.columns || b.rows_seen > target.rows;
    const bool too_few = (b.columns_complete && b.columns_seen < target.columns) ||
                         (b.rows_complete && b.rows_seen < target.rows);
    if (too_many || too_few) ++wrong[{b.columns_seen, b.rows_seen}];
    telling += too_many || b.columns_complete || b.rows_complete;
    if (too_many)
      p.why_unusable =
          fmt::format("shows a grid of {} x {} {}, more than the target's {} x {}", b.columns_seen,
                      b.rows_seen, MarksName(target), target.columns, target.rows);
  }
  if (mirrored > 0)
    return InputError(
        "camera {}: {} of {} pictures show the board mirrored; turn mirroring off in the camera's driver, or "
        "print the board again the right way round",
        camera, mirrored, usable);
  if (2 * other_codes > usable)
    return InputError(
        "camera {}: in {} of {} pictures the board's markers are not where the target has them; correct the "
        "target's dictionary, columns, rows and first_square_white",
        camera, other_codes, usable);
  int num_wrong = 0;
  for (const auto& w : wrong) num_wrong += w.second;
  // A miscount in one view is a hand or a reflection; in half of those that show the board's ends it is the
  // target.
  if (num_wrong >= std::min(2, usable) && num_wrong > 0 && 2 * num_wrong >= telling) {
    const auto most = std::max_element(wrong.begin(), wrong.end(),
                                       [](const auto& a, const auto& b) { return a.second < b.second; });
    return InputError(
        "camera {}: {} of {} pictures that tell show a board of {} x {} {}, but its target says columns = "
        "{}, "
        "rows = {}; correct the target's counts",
        camera, num_wrong, telling, most->first.first, most->first.second, MarksName(target), target.columns,
        target.rows);
  }
  return {};
}

Status CheckDiscSize(const std::string& camera, const TargetSpec& target,
                     const std::vector<BoardPicture>& pictures) {
  if (target.pattern != TargetPattern::kDiscs || target.diameter_mm <= 0) return {};
  std::vector<double> shares;
  for (const auto& p : pictures)
    if (p.why_unusable.empty())
      for (const Mark& m : p.board.marks)
        if (m.diameter_share > 0 && m.size_px > 3) shares.push_back(m.diameter_share);
  if (shares.empty()) return {};
  const double seen = Median(shares), given = target.diameter_mm / target.pitch_mm;
  if (std::abs(seen / given - 1) > kSizeTolerance)
    return InputError(
        "camera {}: the discs are {:.3f} of their pitch in diameter as seen, but the target says {} mm of {} "
        "mm, {:.3f}; measure pitch and diameter on the board and correct them",
        camera, seen, target.diameter_mm, target.pitch_mm, given);
  return {};
}

bool OnOneLine(const std::vector<Mark>& marks) {
  const auto same = [&](auto member) {
    return std::all_of(marks.begin(), marks.end(),
                       [&](const Mark& m) { return m.*member == marks[0].*member; });
  };
  return same(&Mark::column) || same(&Mark::row);
}

// ---- Views ----

struct Views {
  std::vector<BoardView> view;
  std::vector<int> picture;
  std::vector<std::vector<int>> mark;  // index into the picture's marks
};

Views ViewsOf(const TargetSpec& target, const std::vector<BoardPicture>& pictures) {
  Views views;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const BoardPicture& p = pictures[i];
    if (!p.why_unusable.empty()) continue;
    BoardView view;
    view.anchored = p.board.anchored;
    std::vector<int> marks;
    for (std::size_t k = 0; k < p.board.marks.size(); ++k) {
      const Mark& m = p.board.marks[k];
      view.point_in_board.push_back(target.PointOnBoard(m.column, m.row));
      view.img.push_back(m.img);
      marks.push_back(static_cast<int>(k));
    }
    views.view.push_back(std::move(view));
    views.mark.push_back(std::move(marks));
    views.picture.push_back(static_cast<int>(i));
  }
  return views;
}

// The discs' centres instead of their ellipses', with the lens and poses known so far.
std::vector<BoardView> WithoutEccentricity(const TargetSpec& target, const std::vector<BoardView>& views,
                                           const BoardSolution& solution) {
  std::vector<BoardView> corrected = views;
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t i = 0; i < views[v].img.size(); ++i) {
      const Vector2d& p = views[v].point_in_board[i];
      const std::array<int, 2> label{static_cast<int>(std::lround(p.x() / target.pitch_mm)),
                                     static_cast<int>(std::lround(p.y() / target.pitch_mm))};
      const bool other = std::find(target.distinguished.begin(), target.distinguished.end(), label) !=
                         target.distinguished.end();
      const double diameter = other ? target.distinguished_diameter_mm : target.diameter_mm;
      corrected[v].img[i] -=
          DiscEccentricity(solution.intrinsics, solution.cam_from_board[v], p, 0.5 * diameter);
    }
  return corrected;
}

void Erase(Views& views, std::vector<std::vector<Vector2d>>& residuals, std::size_t v, std::size_t i) {
  auto& view = views.view[v];
  view.point_in_board.erase(view.point_in_board.begin() + i);
  view.img.erase(view.img.begin() + i);
  views.mark[v].erase(views.mark[v].begin() + i);
  residuals[v].erase(residuals[v].begin() + i);
}

void EraseView(Views& views, std::size_t v) {
  views.view.erase(views.view.begin() + v);
  views.mark.erase(views.mark.begin() + v);
  views.picture.erase(views.picture.begin() + v);
}

// One coordinate's spread from the median distance, which wrong marks do not move: the median of a Rayleigh
// is 1.1774 sigma.
double RobustSigma(const std::vector<std::vector<Vector2d>>& residuals) {
  std::vector<double> d;
  for (const auto& view : residuals)
    for (const auto& r : view) d.push_back(r.norm());
  return Median(d) / 1.1774;
}

// Cauchy weights, so that wrong marks let go of the lens.
std::vector<std::vector<double>> CauchyWeights(const std::vector<std::vector<Vector2d>>& residuals,
                                               double scale) {
  std::vector<std::vector<double>> weights;
  for (const auto& view : residuals) {
    weights.emplace_back();
    for (const auto& r : view) weights.back().push_back(1 / (1 + r.squaredNorm() / (scale * scale)));
  }
  return weights;
}

// ---- Solving with wrong marks put aside ----

struct Robust {
  Views views;
  std::vector<BoardView> corrected;  // eccentricity out
  BoardSolution solution;
};

class Solver {
 public:
  Solver(const std::string& camera, const TargetSpec& target, const CalibrationOptions& options,
         std::vector<BoardPicture>& pictures, IntrinsicResult& result)
      : camera_(camera), target_(target), options_(options), pictures_(pictures), result_(result) {}

  Result<Robust> Run(const BoardProblemOptions& problem) {
    Robust r{ViewsOf(target_, pictures_), {}, {}};
    VSS_RETURN_IF_ERROR(CheckNumber(r.views));
    auto solved = SolveBoards(r.views.view, problem);
    if (!solved) return InputError("camera {}: {}", camera_, solved.error().message);
    r.solution = *solved;
    VSS_RETURN_IF_ERROR(DropWrongMarks(problem, r));
    return Polish(problem, std::move(r));
  }

 private:
  Status CheckNumber(const Views& views) {
    if (static_cast<int>(views.view.size()) >= kMinViews) return {};
    std::string why;
    for (const auto& p : pictures_)
      if (!p.why_unusable.empty() && why.size() < 400)
        why += fmt::format("{}{}: {}", why.empty() ? "; " : ", ", p.file, p.why_unusable);
    return InputError(
        "camera {}: {} of {} pictures show a usable board, but a calibration needs at least {} from "
        "different directions{}",
        camera_, views.view.size(), pictures_.size(), kMinViews, why);
  }

  bool IsDisc() const { return target_.pattern == TargetPattern::kDiscs && target_.diameter_mm > 0; }

  Result<BoardSolution> Again(const BoardProblemOptions& problem, const Robust& r,
                              const std::vector<std::vector<double>>* weights) {
    const auto corrected = IsDisc() ? WithoutEccentricity(target_, r.views.view, r.solution) : r.views.view;
    return SolveBoards(corrected, problem, weights, &r.solution);
  }

  // Least squares shows whether there is anything wrong; only then the robust fit, then least squares of the
  // rest.
  Status DropWrongMarks(const BoardProblemOptions& problem, Robust& r) {
    constexpr int kMaxRounds = 6;
    for (int round = 0; round < kMaxRounds; ++round) {
      double sigma = RobustSigma(r.solution.residual_px);
      if (Worst(r.solution.residual_px) <= Limit(sigma)) return {};
      for (int i = 0; i < 4; ++i) {
        const auto weights = CauchyWeights(r.solution.residual_px, 2.5 * sigma);
        VSS_ASSIGN(r.solution, Again(problem, r, &weights));
        sigma = RobustSigma(r.solution.residual_px);
      }
      if (!DropBeyond(Limit(sigma), r)) {
        VSS_ASSIGN(r.solution, Again(problem, r, nullptr));
        return {};
      }
      VSS_RETURN_IF_ERROR(CheckNumber(r.views));
      VSS_ASSIGN(r.solution, Again(problem, r, nullptr));
    }
    return {};
  }

  double Limit(double sigma) const { return std::max(kMinDropPx, options_.outlier_sigmas * sigma); }

  static double Worst(const std::vector<std::vector<Vector2d>>& residuals) {
    double worst = 0;
    for (const auto& view : residuals)
      for (const auto& e : view) worst = std::max(worst, e.norm());
    return worst;
  }

  bool DropBeyond(double limit, Robust& r) {
    auto residuals = r.solution.residual_px;
    bool any = false;
    for (std::size_t v = r.views.view.size(); v-- > 0;) {
      std::vector<DroppedMark> dropped;
      const std::size_t before = residuals[v].size();
      for (std::size_t i = residuals[v].size(); i-- > 0;) {
        const double d = residuals[v][i].norm();
        if (d <= limit) continue;
        const Mark& mark = pictures_[r.views.picture[v]].board.marks[r.views.mark[v][i]];
        dropped.push_back({pictures_[r.views.picture[v]].file, mark.column, mark.row, d});
        Erase(r.views, residuals, v, i);
      }
      if (dropped.empty()) continue;
      any = true;
      if (dropped.size() > kMaxDropShare * before || residuals[v].size() < kMinMarksInView) {
        pictures_[r.views.picture[v]].why_unusable = fmt::format(
            "{} of its {} marks do not fit the other views (up to {:.2f} px off): the board moved or bent, "
            "or another grid was taken for it",
            dropped.size(), before, dropped.back().distance_px);
        EraseView(r.views, v);
        residuals.erase(residuals.begin() + v);
        r.solution.cam_from_board.erase(r.solution.cam_from_board.begin() + v);
        r.solution.residual_px.erase(r.solution.residual_px.begin() + v);
      } else {
        result_.dropped.insert(result_.dropped.end(), dropped.rbegin(), dropped.rend());
      }
    }
    r.solution.residual_px = residuals;
    return any;
  }

  Result<Robust> Polish(const BoardProblemOptions& problem, Robust r) {
    r.corrected = r.views.view;
    if (!IsDisc()) return r;
    // The eccentricity depends on lens and pose, and they on it, weakly: twice is enough for 1e-5 px.
    for (int i = 0; i < 2; ++i) {
      r.corrected = WithoutEccentricity(target_, r.views.view, r.solution);
      VSS_ASSIGN(r.solution, SolveBoards(r.corrected, problem, nullptr, &r.solution));
    }
    return r;
  }

  const std::string& camera_;
  const TargetSpec& target_;
  const CalibrationOptions& options_;
  std::vector<BoardPicture>& pictures_;
  IntrinsicResult& result_;
};

// ---- Checks of the solution ----

double AngleDeg(const Vector3d& a, const Vector3d& b) {
  return DegFromRad(std::acos(std::clamp(a.dot(b), -1.0, 1.0)));
}

int CountOrientations(const std::vector<RigidTransform>& poses, double min_angle_deg) {
  std::vector<Vector3d> kinds;
  for (const auto& pose : poses) {
    const Vector3d n = pose.rotation.col(2);
    if (std::all_of(kinds.begin(), kinds.end(),
                    [&](const Vector3d& k) { return AngleDeg(k, n) >= min_angle_deg; }))
      kinds.push_back(n);
  }
  return static_cast<int>(kinds.size());
}

// How much worse the marks are explained with a focal length a quarter longer or shorter: the views' own
// voice on it.
double FocalGrip(const std::vector<BoardView>& views, BoardProblemOptions problem,
                 const BoardSolution& solution) {
  double grip = 1e9;
  for (double factor : {0.8, 1.25}) {
    BoardSolution start = solution;
    start.intrinsics.fx_px *= factor, start.intrinsics.fy_px *= factor;
    for (auto& pose : start.cam_from_board) pose.translation.z() *= factor;
    problem.fix_focal = true;
    const auto other = SolveBoards(views, problem, nullptr, &start);
    if (other)
      grip =
          std::min(grip, other->rms_px * other->rms_px / std::max(1e-18, solution.rms_px * solution.rms_px));
  }
  return grip;
}

Status CheckGeometry(const std::string& camera, const CalibrationOptions& options,
                     const std::vector<BoardView>& views, const BoardProblemOptions& problem,
                     const BoardSolution& s) {
  constexpr double kMinGrip =
      1.5;  // a quarter of the focal length must cost half as much again in squared residual
  for (const auto& pose : s.cam_from_board)
    if (!(pose.rotation.col(2).z() > 0))
      return InputError(
          "camera {}: the board is seen from behind, so its marks are mirrored; count columns from left to "
          "right as seen from the front",
          camera);
  const int orientations = CountOrientations(s.cam_from_board, options.min_tilt_deg);
  const char* remedy = "tilt the board by 20 to 45 degrees to the left, right, front and back";
  if (s.covariance.size() == 0 || FocalGrip(views, problem, s) < kMinGrip)
    return InputError(
        "camera {}: the boards of all {} views face the camera alike or are parallel, so the focal length is "
        "not determined (one that is a quarter off fits as well); {}",
        camera, s.cam_from_board.size(), remedy);
  if (orientations < 3)
    return InputError(
        "camera {}: the {} views show the board in {} orientation{} only (less than {} degrees apart count "
        "as one), but a lens needs three; {}",
        camera, s.cam_from_board.size(), orientations, orientations == 1 ? "" : "s", options.min_tilt_deg,
        remedy);
  if (s.rms_px > options.max_residual_px)
    return InputError(
        "camera {}: the marks are {:.2f} px RMS from where any lens would have them, above {} px; check the "
        "target's pattern, pitch and counts, and that the board is flat",
        camera, s.rms_px, options.max_residual_px);
  return {};
}

Status CheckAspect(const std::string& camera, const Intrinsics& lens, const Vector2d& pitch,
                   IntrinsicResult& result) {
  if (!(pitch.x() > 0 && pitch.y() > 0)) return {};
  const double seen = lens.fx_px / lens.fy_px, given = pitch.y() / pitch.x();
  if (std::abs(seen / given - 1) > kAspectTolerance)
    return InputError(
        "camera {}: the picture is {:.1f} % wider than the pixel pitch [{}, {}] says; check the pixel pitch, "
        "and that the target's pitch is the same along rows and columns",
        camera, 100 * (seen / given - 1), pitch.x(), pitch.y());
  if (std::abs(seen / given - 1) > 0.3 * kAspectTolerance)
    result.warnings.push_back(
        fmt::format("camera {}: the picture is {:.1f} % wider than the pixel pitch says; where the data "
                    "sheet is sure, measure the target's pitch along rows and columns",
                    camera, 100 * (seen / given - 1)));
  return {};
}

// A board whose rows are farther apart than its columns: turned in its plane from view to view it cannot be
// taken for pixels that are not square, and the marks fit better with the distances that it really has.
Status CheckBoardAspect(const std::string& camera, const std::vector<BoardView>& views,
                        const BoardProblemOptions& problem, const BoardSolution& solution,
                        IntrinsicResult& result) {
  constexpr double kStep = 0.01;                  // of the distance of the rows
  constexpr double kMaxStretch = 0.5;             // more is another fault
  constexpr double kMinGain = 0.5;                // of the squared residual
  constexpr double kWarn = 2e-3, kRefuse = 1e-2;  // what a printer does, and what it does not
  const auto cost = [&](double stretch) {
    std::vector<BoardView> stretched = views;
    for (auto& view : stretched)
      for (auto& p : view.point_in_board) p.y() *= 1 + stretch;
    const auto solved = SolveBoards(stretched, problem, nullptr, &solution);
    return solved ? solved->rms_px * solved->rms_px : std::numeric_limits<double>::infinity();
  };
  const double here = solution.rms_px * solution.rms_px;
  double stretch = 0;
  for (double step : {kStep, kStep, kStep / 5}) {  // towards the foot of the parabola through three costs
    const double low = cost(stretch - step), high = cost(stretch + step),
                 bend = low + high - 2 * (stretch == 0 ? here : cost(stretch));
    if (!std::isfinite(bend) || !(bend > 0)) return {};
    stretch += 0.5 * step * (low - high) / bend;
    if (std::abs(stretch) < kWarn || std::abs(stretch) > kMaxStretch) return {};
  }
  if (cost(stretch) > kMinGain * here) return {};
  const std::string words = fmt::format(
      "camera {}: the board's rows are {:.1f} % {} apart than its columns by the marks, but the target has "
      "one pitch "
      "for both; print the board at the same scale both ways, or measure the pitch along rows and columns",
      camera, 100 * std::abs(stretch), stretch > 0 ? "farther" : "less far");
  if (std::abs(stretch) > kRefuse) return InputError("{}", words);
  result.warnings.push_back(words);
  return {};
}

// ---- Hold-out ----

struct Halves {
  bool valid = false;
  double holdout_px = 0;
  Intrinsics odd, even;
};

Halves HoldOut(const std::vector<BoardView>& views, const BoardProblemOptions& problem,
               const BoardSolution& whole) {
  Halves halves;
  std::vector<BoardView> part[2];
  BoardSolution start[2] = {whole, whole};
  for (int h = 0; h < 2; ++h) start[h].cam_from_board.clear();
  for (std::size_t v = 0; v < views.size(); ++v) {
    part[v % 2].push_back(views[v]);
    start[v % 2].cam_from_board.push_back(whole.cam_from_board[v]);
  }
  if (part[1].size() < 2) return halves;
  double sum = 0, n = 0;
  for (int h = 0; h < 2; ++h) {
    const auto solved = SolveBoards(part[h], problem, nullptr, &start[h]);
    if (!solved) return halves;
    (h == 0 ? halves.odd : halves.even) = solved->intrinsics;
    const auto other = SolveBoardPoses(part[1 - h], problem, *solved);
    if (!other) return halves;
    for (const auto& view : other->residual_px)
      for (const auto& r : view) sum += r.squaredNorm(), n += 1;
  }
  halves.holdout_px = std::sqrt(sum / n);
  halves.valid = std::isfinite(halves.holdout_px);
  return halves;
}

// ---- Further terms ----

// A further term is taken where the views that took no part say that it helps, and its value is sure.
void ChooseTerms(const CalibrationOptions& options, const std::vector<BoardView>& views,
                 BoardProblemOptions& problem, BoardSolution& solution, Halves& halves,
                 IntrinsicResult& result) {
  constexpr double kMinGain =
      0.02;  // of the hold-out residual: for less, a weakly determined principal point is no fair price
  constexpr double kMinSigmas = 4;
  std::vector<std::vector<std::string>> candidates{{"s1", "s2"}, {"bow"}};
  if (problem.model == LensModel::kOpenCv) candidates.insert(candidates.begin(), {"k3"});
  for (const auto& names : candidates) {
    const bool bow = names[0] == "bow";
    if (bow && options.bow) continue;
    if (bow && std::count_if(views.begin(), views.end(), [](const BoardView& v) { return v.anchored; }) * 2 <
                   static_cast<int>(views.size()))
      continue;
    BoardProblemOptions wider = problem;
    if (bow)
      wider.estimate_bow = true;
    else
      for (const auto& name : names) wider.terms.push_back(NamedTerm(problem.model, name));
    const auto solved = SolveBoards(views, wider, nullptr, &solution);
    if (!solved || solved->covariance.size() == 0) continue;
    const Halves wider_halves = HoldOut(views, wider, *solved);
    const int first = static_cast<int>(bow ? 4 + wider.terms.size() : 4 + problem.terms.size());
    double value = 0, sigma = 1, best = 0;
    for (int i = 0; i < static_cast<int>(bow ? 2 : names.size()); ++i) {
      const double v = bow ? solved->bow_mm[i] : solved->term_values[first - 4 + i],
                   s = std::sqrt(solved->covariance(first + i, first + i));
      if (std::abs(v) / s > best) best = std::abs(v) / s, value = v, sigma = s;
    }
    const bool taken = wider_halves.valid && halves.valid &&
                       wider_halves.holdout_px < (1 - kMinGain) * halves.holdout_px && best > kMinSigmas;
    std::string label = names[0];
    for (std::size_t i = 1; i < names.size(); ++i) label += " " + names[i];
    result.choices.push_back({label, wider_halves.holdout_px, value, sigma, taken});
    if (!taken) continue;
    problem = wider, solution = *solved, halves = wider_halves;
  }
}

// ---- Report of quality ----

MatrixXd FileCovariance(const BoardProblemOptions& problem, const BoardSolution& s) {
  if (s.covariance.size() == 0) return {};
  const int terms = static_cast<int>(problem.terms.size());
  const MatrixXd d = DistortionFromTerms(problem);
  MatrixXd map = MatrixXd::Zero(4 + d.rows(), 4 + terms);
  map.topLeftCorner(4, 4).setIdentity();
  map.bottomRightCorner(d.rows(), terms) = d;
  return map * s.covariance.topLeftCorner(4 + terms, 4 + terms) * map.transpose();
}

void FillViewQuality(const std::vector<BoardPicture>& pictures, IntrinsicResult& result) {
  for (const auto& p : pictures) {
    ViewQuality q;
    q.file = p.file;
    q.why_not = p.why_unusable;
    std::vector<double> blur;
    for (const Mark& m : p.board.marks) blur.push_back(m.blur_px);
    q.blur_px = Median(blur);
    q.num_marks = static_cast<int>(p.board.marks.size());
    result.quality.push_back(q);
  }
  for (std::size_t v = 0; v < result.views.size(); ++v) {
    ViewQuality& q = result.quality[result.picture_of_view[v]];
    q.used = true;
    double sum = 0;
    for (const auto& r : result.solution.residual_px[v]) sum += r.squaredNorm();
    q.num_dropped = q.num_marks - static_cast<int>(result.views[v].img.size());
    q.rms_px = std::sqrt(sum / std::max<std::size_t>(1, result.views[v].img.size()));
    q.tilt_deg = AngleDeg(result.solution.cam_from_board[v].rotation.col(2), Vector3d::UnitZ());
    q.distance_mm =
        (result.solution.cam_from_board[v] *
         Vector3d(result.views[v].point_in_board[result.views[v].img.size() / 2].homogeneous().cwiseProduct(
             Vector3d(1, 1, 0))))
            .norm();
  }
}

void FillCoverage(IntrinsicResult& result) {
  constexpr int kCells = 8;  // a side
  PictureMap& map = result.coverage;
  map = {kCells, kCells, std::vector<double>(kCells * kCells, 0), 0, 0};
  for (const auto& view : result.views)
    for (const Vector2d& p : view.img) {
      const int i = std::clamp(static_cast<int>((p.x() + 0.5) / result.width_px * kCells), 0, kCells - 1);
      const int j = std::clamp(static_cast<int>((p.y() + 0.5) / result.height_px * kCells), 0, kCells - 1);
      map.value[j * kCells + i] += 1;
    }
  result.covered_share = std::count_if(map.value.begin(), map.value.end(), [](double n) { return n > 0; }) /
                         double(kCells * kCells);
  Summarise(map);
}

void Warn(const std::string& camera, const TargetSpec& target, IntrinsicResult& r) {
  const auto warn = [&](std::string text) { r.warnings.push_back("camera " + camera + ": " + text); };
  std::vector<double> blurs;
  for (const auto& q : r.quality)
    if (q.used) blurs.push_back(q.blur_px);
  const double usual = Median(blurs);
  for (const auto& q : r.quality) {
    if (q.used && q.blur_px > kBlurRatio * usual)
      warn(
          fmt::format("{} is blurred ({:.2f} px against {:.2f} px of the others); take it again without "
                      "motion and in focus",
                      q.file, q.blur_px, usual));
    if (!q.used) warn(fmt::format("{} was not used: {}", q.file, q.why_not));
  }
  if (target.pattern == TargetPattern::kCharuco && 2 * r.num_by_codes < static_cast<int>(r.views.size()))
    warn(fmt::format(
        "the markers could be read in {} of {} views only, so which corners are seen was counted; "
        "check the target's dictionary and marker, and the sharpness",
        r.num_by_codes, r.views.size()));
  if (!r.dropped.empty())
    warn(fmt::format("{} marks were dropped as wrong, the worst {:.2f} px off", r.dropped.size(),
                     std::max_element(r.dropped.begin(), r.dropped.end(), [](const auto& a, const auto& b) {
                       return a.distance_px < b.distance_px;
                     })->distance_px));
  if (r.covered_share < 0.8)
    warn(fmt::format("only {:.0f} % of the picture has marks; where there were none the lens is guessed",
                     100 * r.covered_share));
  double max_tilt = 0;
  for (const auto& q : r.quality) max_tilt = std::max(max_tilt, q.tilt_deg);
  if (max_tilt < 15)
    warn(fmt::format(
        "no board is tilted by more than {:.0f} degrees; the focal length is weak, tilt it by 20 to 45",
        max_tilt));
  const double relative = r.covariance.size() ? std::sqrt(r.covariance(0, 0)) / r.intrinsics.fx_px : 1;
  if (relative > 2e-3)
    warn(
        fmt::format("the focal length is known to {:.2f} % only, which is as much of every distance; add "
                    "views with the board tilted and near",
                    100 * relative));
  if (r.halves_difference_px.rms > 5 * std::max(0.01, r.uncertainty_px.rms) &&
      r.halves_difference_px.rms > 0.1)
    warn(
        fmt::format("the odd and the even views disagree by {:.2f} px RMS over the picture (predicted "
                    "{:.2f}); some views, or the board's flatness, are not to be trusted",
                    r.halves_difference_px.rms, 1.41 * r.uncertainty_px.rms));
  if (target.pattern == TargetPattern::kDiscs && target.diameter_mm <= 0)
    warn("the target's diameter is not given, so the discs' eccentricity was not corrected; add diameter");
}

// ---- What to photograph next ----

struct Candidate {
  std::string words;
  RigidTransform cam_from_board;
};

std::vector<Candidate> CandidateViews(const IntrinsicResult& r, const TargetSpec& target) {
  const Vector2d board = target.PointOnBoard(target.columns - 1, target.rows - 1);
  const char* where[3][3] = {{"at the top left", "at the top", "at the top right"},
                             {"at the left", "in the middle", "at the right"},
                             {"at the bottom left", "at the bottom", "at the bottom right"}};
  std::vector<Candidate> list;
  for (double share : {0.45, 0.8})  // of the picture that the board fills
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        for (int t = 0; t < 5; ++t) {
          const double tilt = t == 0 ? 0 : RadFromDeg(40);
          const Vector3d axis = t == 1   ? Vector3d(0, 1, 0)
                                : t == 2 ? Vector3d(0, -1, 0)
                                : t == 3 ? Vector3d(1, 0, 0)
                                         : Vector3d(-1, 0, 0);
          const char* lean[] = {"facing the camera", "turned 40 degrees to the left",
                                "turned 40 degrees to the right", "tipped 40 degrees forward",
                                "tipped 40 degrees back"};
          const Vector2d middle(r.width_px * (0.2 + 0.3 * i), r.height_px * (0.2 + 0.3 * j));
          const auto ray = r.intrinsics.NormalizedFromImg(middle);
          if (!ray) continue;
          const double z = r.intrinsics.fx_px * board.x() / (share * r.width_px);
          const Eigen::Matrix3d rotation = RotationFromVector(tilt * axis);
          const Vector3d centre = z * ray->homogeneous();
          list.push_back({fmt::format("the board {} of the picture, filling about {:.0f} % of its width, {}",
                                      where[j][i], 100 * share, lean[t]),
                          {rotation, centre - rotation * Vector3d(board.x() / 2, board.y() / 2, 0)}});
        }
  return list;
}

// The view, of a fixed list, that would lower the predicted uncertainty most: its marks' information, its own
// pose eliminated.
std::string NextView(const IntrinsicResult& r, const TargetSpec& target) {
  if (r.covariance.size() == 0 || r.problem.estimate_bow) return "";
  const int n = 4 + static_cast<int>(r.problem.terms.size());
  const MatrixXd information =
      r.solution.covariance.topLeftCorner(n, n).inverse() * (r.solution.sigma_px * r.solution.sigma_px);
  const MatrixXd distortion = DistortionFromTerms(r.problem);
  double best = r.uncertainty_px.rms;
  std::string words;
  for (const Candidate& c : CandidateViews(r, target)) {
    MatrixXd shared = MatrixXd::Zero(n, n), mixed = MatrixXd::Zero(n, 6);
    Matrix6d own = Matrix6d::Zero();
    int seen = 0;
    for (int row = 0; row < target.rows; ++row)
      for (int column = 0; column < target.columns; ++column) {
        const Vector2d p = target.PointOnBoard(column, row);
        const Vector3d point = c.cam_from_board * Vector3d(p.x(), p.y(), 0);
        Eigen::Matrix<double, 2, 3> by_point;
        const auto img = r.intrinsics.Project(point, &by_point);
        if (!img || img->x() < 4 || img->y() < 4 || img->x() > r.width_px - 5 || img->y() > r.height_px - 5)
          continue;
        const MatrixXd ray = -RayJacobian(r.intrinsics, *img);  // d img / d lens at a fixed ray
        MatrixXd by_lens(2, n);
        by_lens << ray.leftCols(4), ray.rightCols(distortion.rows()) * distortion;
        Eigen::Matrix<double, 2, 6> by_pose;
        by_pose << -by_point * CrossMatrix(point - c.cam_from_board.translation), by_point;
        shared += by_lens.transpose() * by_lens, mixed += by_lens.transpose() * by_pose,
            own += by_pose.transpose() * by_pose;
        ++seen;
      }
    if (seen < target.columns * target.rows / 3 || !shared.allFinite()) continue;
    const MatrixXd more = information + shared - mixed * own.ldlt().solve(mixed.transpose());
    MatrixXd map = MatrixXd::Zero(4 + distortion.rows(), n);
    map.topLeftCorner(4, 4).setIdentity();
    map.bottomRightCorner(distortion.rows(), n - 4) = distortion;
    const MatrixXd covariance =
        map * more.inverse() * map.transpose() * (r.solution.sigma_px * r.solution.sigma_px);
    const double rms = UncertaintyMap(r.intrinsics, covariance, r.width_px, r.height_px).rms;
    if (rms < best) best = rms, words = c.words;
  }
  if (words.empty()) return "No further view would help by much.";
  return fmt::format(
      "Photograph next: {}; it would lower the predicted uncertainty from {:.4f} to {:.4f} px.", words,
      r.uncertainty_px.rms, best);
}

void Describe(const std::string& camera, const BoardProblemOptions& problem, IntrinsicResult& r) {
  std::string terms;
  for (const auto& t : problem.terms) terms += (terms.empty() ? "" : ", ") + t.name;
  r.findings.push_back(
      fmt::format("Camera {}: {} views and {} marks fit to {:.4f} px RMS; estimated were fx, fy, cx, cy, {}.",
                  camera, r.views.size(),
                  std::accumulate(r.views.begin(), r.views.end(), std::size_t{0},
                                  [](std::size_t n, const BoardView& v) { return n + v.img.size(); }),
                  r.solution.rms_px, terms));
  if (r.holdout_px > 0)
    r.findings.push_back(
        fmt::format("Views that took no part fit to {:.4f} px; the lenses of the odd and of the even views "
                    "differ by {:.4f} px RMS over the picture.",
                    r.holdout_px, r.halves_difference_px.rms));
  r.findings.push_back(
      fmt::format("A ray is predicted to {:.4f} px RMS over the picture, {:.4f} px at worst; {:.0f} % of the "
                  "picture has marks.",
                  r.uncertainty_px.rms, r.uncertainty_px.max, 100 * r.covered_share));
  for (const auto& c : r.choices)
    r.findings.push_back(fmt::format("{} {}: hold-out {:.4f} px, largest value {:.4g} with sigma {:.2g}.",
                                     c.term, c.taken ? "was added" : "was not added", c.holdout_px, c.value,
                                     c.sigma));
  if (problem.estimate_bow)
    r.findings.push_back(
        fmt::format("The board is bowed by {:.3f} mm along its rows and {:.3f} mm along its columns.",
                    r.solution.bow_mm.x(), r.solution.bow_mm.y()));
}

}  // namespace

std::span<const ParameterOf<CalibrationOptions>> CalibrationParameters() {
  static const ParameterOf<CalibrationOptions> rows[] = {
      {"calibrate.opencv", &CalibrationOptions::opencv, 0, 1, "",
       "The lens is written in OpenCV's model instead of Weng's."},
      {"calibrate.choose_terms", &CalibrationOptions::choose_terms, 0, 1, "",
       "Further lens terms and the board's bow are estimated where a hold-out and their sigma say so."},
      {"calibrate.bow", &CalibrationOptions::bow, 0, 1, "",
       "The board's bow is estimated whatever the hold-out says."},
      {"calibrate.outlier_sigmas", &CalibrationOptions::outlier_sigmas, 3, 100, "",
       "Marks farther off than this many robust sigmas are dropped."},
      {"calibrate.max_residual_px", &CalibrationOptions::max_residual_px, 0.01, 100, "px",
       "A calibration with a larger residual is refused."},
      {"calibrate.min_tilt_deg", &CalibrationOptions::min_tilt_deg, 1, 45, "deg",
       "Boards less than this apart in orientation count as one."}};
  return rows;
}

Result<IntrinsicResult> CalibrateIntrinsics(const std::string& camera, const TargetSpec& target,
                                            const std::vector<BoardPicture>& given, const Vector2d& pitch,
                                            const CalibrationOptions& options) {
  IntrinsicResult result;
  if (given.empty()) return InputError("camera {}: there is no picture of its board", camera);
  std::vector<BoardPicture> pictures = given;
  VSS_RETURN_IF_ERROR(CheckSizes(camera, pictures));
  VSS_RETURN_IF_ERROR(CheckCounts(camera, target, pictures));
  VSS_RETURN_IF_ERROR(CheckDiscSize(camera, target, pictures));
  for (auto& p : pictures)
    if (p.why_unusable.empty() && p.board.marks.size() < kMinMarksInView)
      p.why_unusable = fmt::format("shows {} marks, fewer than {}", p.board.marks.size(), kMinMarksInView);
  for (auto& p : pictures)
    if (p.why_unusable.empty() && OnOneLine(p.board.marks))
      p.why_unusable =
          fmt::format("its {} marks lie on one line, which says nothing of the plane", p.board.marks.size());
  result.width_px = pictures[0].width_px, result.height_px = pictures[0].height_px;

  BoardProblemOptions& problem = result.problem;
  problem.model = options.opencv ? LensModel::kOpenCv : LensModel::kWeng;
  problem.terms = DefaultTerms(problem.model);
  problem.estimate_bow = options.bow;
  problem.board_size_mm = target.PointOnBoard(target.columns - 1, target.rows - 1);
  problem.width_px = result.width_px, problem.height_px = result.height_px;
  VSS_ASSIGN(Robust robust, Solver(camera, target, options, pictures, result).Run(problem));
  VSS_RETURN_IF_ERROR(CheckGeometry(camera, options, robust.corrected, problem, robust.solution));
  VSS_RETURN_IF_ERROR(CheckBoardAspect(camera, robust.corrected, problem, robust.solution, result));
  Halves halves = HoldOut(robust.corrected, problem, robust.solution);
  if (options.choose_terms) ChooseTerms(options, robust.corrected, problem, robust.solution, halves, result);

  result.solution = robust.solution;
  result.views = robust.corrected;
  result.picture_of_view = robust.views.picture;
  for (int p : result.picture_of_view) result.num_by_codes += pictures[p].board.by_codes;
  result.intrinsics = robust.solution.intrinsics;
  result.intrinsics.pixel_pitch_v_mm =
      problem.model == LensModel::kWeng ? (pitch.y() > 0 ? pitch.y() : 0.01) : 0;
  VSS_RETURN_IF_ERROR(CheckAspect(camera, result.intrinsics, pitch, result));
  result.covariance = FileCovariance(problem, result.solution);
  result.holdout_px = halves.valid ? halves.holdout_px : 0;
  if (halves.valid)
    result.halves_difference_px = LensDifference(halves.odd, halves.even, result.width_px, result.height_px);
  result.uncertainty_px =
      UncertaintyMap(result.intrinsics, result.covariance, result.width_px, result.height_px);
  FillViewQuality(pictures, result);
  FillCoverage(result);
  Warn(camera, target, result);
  Describe(camera, problem, result);
  result.next_view = NextView(result, target);
  return result;
}

}  // namespace vss
