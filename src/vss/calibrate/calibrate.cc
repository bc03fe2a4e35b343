#include "vss/calibrate/calibrate.h"

#include <algorithm>
#include <numeric>

#include "vss/base/parallel.h"

namespace vss {
namespace fs = std::filesystem;
namespace {

constexpr double kPitchWhereNoneIsGivenMm = 0.01;  // only the unit of image_distance depends on it

Result<GreyImage> ReadLinear(const BoardFile& file, Response response) {
  VSS_ASSIGN(GreyImage image, ReadImage(file.path));
  if (response == Response::kSrgb) return LinearFromSrgb(image.view());
  return image;
}

// The marks of every board picture of every camera, in parallel over pictures.
Result<std::vector<std::vector<BoardPicture>>> FindAllMarks(const CalibrationJob& job, int threads,
                                                            const Progress& progress) {
  std::vector<std::pair<int, int>> work;
  std::vector<std::vector<BoardPicture>> pictures(job.intrinsic.size());
  for (std::size_t c = 0; c < job.intrinsic.size(); ++c) {
    pictures[c].resize(job.intrinsic[c].images.size());
    for (std::size_t i = 0; i < pictures[c].size(); ++i)
      work.push_back({static_cast<int>(c), static_cast<int>(i)});
  }
  std::vector<Status> outcome(work.size());
  std::atomic<int> done{0};
  ParallelFor(work.size(), threads, [&](std::size_t w) {
    if (progress.Cancelled()) return;
    const auto [c, i] = work[w];
    const IntrinsicJob& lens = job.intrinsic[c];
    BoardPicture& picture = pictures[c][i];
    picture.file = lens.images[i].name;
    auto image = ReadLinear(lens.images[i], lens.response);
    if (!image) {
      outcome[w] = tl::unexpected(image.error());
      return;
    }
    picture.width_px = image->width(), picture.height_px = image->height();
    auto marks = FindMarks(image->view(), lens.target);
    if (marks)
      picture.board = std::move(*marks);
    else
      picture.why_unusable = marks.error().message;
    progress.Report("marks", ++done, static_cast<int>(work.size()));
  });
  if (progress.Cancelled()) return Cancelled();
  for (const Status& s : outcome) VSS_RETURN_IF_ERROR(s);
  return pictures;
}

// A board that stood still while the gantry moved: the moves measure its pitch.
Status CheckPitch(const IntrinsicJob& job, const Gantry& gantry, const IntrinsicResult& lens) {
  constexpr double kMaxError = 0.02, kMinTravelMm = 50;
  double sum_seen = 0, sum_said = 0;
  for (std::size_t a = 0; a < lens.views.size(); ++a)
    for (std::size_t b = a + 1; b < lens.views.size(); ++b) {
      const auto &ga = job.images[lens.picture_of_view[a]].gantry_mm,
                 &gb = job.images[lens.picture_of_view[b]].gantry_mm;
      if (!ga || !gb || !lens.views[a].anchored || !lens.views[b].anchored) continue;
      const double said = (gantry.axes * (*ga - *gb)).norm();
      const auto &pa = lens.solution.cam_from_board[a], &pb = lens.solution.cam_from_board[b];
      // Only pairs between which the board did not turn against the camera tell the gantry's move.
      if (said < kMinTravelMm || VectorFromRotation(pa.rotation * pb.rotation.transpose()).norm() > 0.01)
        continue;
      sum_seen += (pa.translation - pb.translation).norm(), sum_said += said;
    }
  if (sum_said > 0 && std::abs(sum_seen / sum_said - 1) > kMaxError)
    return InputError(
        "camera {}: over the gantry's moves the board is {:.1f} % {} than its pitch of {} mm says; measure "
        "the pitch on the board",
        job.camera, 100 * std::abs(sum_said / sum_seen - 1), sum_said > sum_seen ? "larger" : "smaller",
        job.target.pitch_mm);
  return {};
}

Result<CameraCalibration> CalibrateLens(const IntrinsicJob& job, const Gantry& gantry,
                                        const std::vector<BoardPicture>& pictures,
                                        CalibrationOptions options) {
  options.bow = options.bow || job.bow;
  CameraCalibration c;
  const Eigen::Vector2d pitch = job.pixel_pitch_mm.x() > 0 ? job.pixel_pitch_mm : Eigen::Vector2d::Zero();
  VSS_ASSIGN(c.lens, CalibrateIntrinsics(job.camera, job.target, pictures, pitch, options));
  VSS_RETURN_IF_ERROR(CheckPitch(job, gantry, *c.lens));
  c.target = job.target;
  c.camera.id = job.camera;
  c.camera.width_px = c.lens->width_px, c.camera.height_px = c.lens->height_px;
  c.camera.response = job.response;
  c.camera.intrinsics = c.lens->intrinsics;
  if (c.camera.intrinsics.model == LensModel::kWeng && pitch.y() <= 0) {
    c.camera.intrinsics.pixel_pitch_v_mm = kPitchWhereNoneIsGivenMm;
    c.lens->findings.push_back(
        fmt::format("Camera {}: no pixel_pitch is given, so image_distance counts pixels of {} mm.",
                    job.camera, kPitchWhereNoneIsGivenMm));
  }
  CalibrationQuality quality;
  quality.residual_px = c.lens->solution.rms_px;
  quality.num_views = static_cast<int>(c.lens->views.size());
  quality.covariance = c.lens->covariance;
  quality.warnings = c.lens->warnings;
  quality.about = job.about;
  c.camera.quality = quality;
  return c;
}

Result<std::vector<CubePicture>> ReadCubePictures(const ExtrinsicJob& job, const Camera& camera) {
  std::vector<CubePicture> pictures;
  for (const BoardFile& file : job.images) {
    VSS_ASSIGN(GreyImage image, ReadLinear(file, camera.response));
    if (image.width() != camera.width_px || image.height() != camera.height_px)
      return InputError(
          "camera {}: {} has {} x {} px, but the lens was calibrated with {} x {}; take the cube with the "
          "same setting",
          job.camera, file.name, image.width(), image.height(), camera.width_px, camera.height_px);
    pictures.push_back({file.name, std::move(image), *file.gantry_mm});
  }
  return pictures;
}

void SetAxes(const Calibration& calibration, CameraCalibration& c) {
  if (!c.place || calibration.gantry.axes == Eigen::Matrix3d::Identity()) return;
  c.camera.gantry_axes = calibration.gantry.axes;
  if (!calibration.axes) return;
  c.camera.gantry_axes_sigma = calibration.axes->sigma;
  c.camera.gantry_middle_mm = c.place->middle_mm;
}

void SetPlace(const CubeResult& place, CameraCalibration& c) {
  c.place = place;
  c.camera.cam_from_world = place.cam_from_world;
  c.camera.gantry_mm.setZero();
  if (!c.camera.quality) c.camera.quality = CalibrationQuality{};
  auto& quality = *c.camera.quality;
  const int n = 4 + c.camera.intrinsics.num_distortion;
  const Eigen::MatrixXd lens = quality.covariance.rows() >= n
                                   ? Eigen::MatrixXd(quality.covariance.topLeftCorner(n, n))
                                   : Eigen::MatrixXd::Zero(n, n);
  quality.covariance = JointCovariance(lens, place);
  quality.warnings.insert(quality.warnings.end(), place.warnings.begin(), place.warnings.end());
}

}  // namespace

Result<Calibration> Calibrate(const CalibrationJob& job, const CalibrationOptions& options, int threads,
                              const Progress& progress) {
  Calibration calibration;
  calibration.name = job.name;
  calibration.gantry = job.gantry;
  VSS_ASSIGN(const auto pictures, FindAllMarks(job, threads, progress));
  std::vector<Result<CameraCalibration>> lenses(job.intrinsic.size(), InputError("not calibrated"));
  ParallelFor(job.intrinsic.size(), threads, [&](std::size_t i) {
    lenses[i] = CalibrateLens(job.intrinsic[i], job.gantry, pictures[i], options);
  });
  for (auto& lens : lenses) {
    VSS_ASSIGN(CameraCalibration c, std::move(lens));
    calibration.cameras.push_back(std::move(c));
  }
  if (progress.Cancelled()) return Cancelled();
  std::vector<int> camera_of_job;
  for (const ExtrinsicJob& e : job.extrinsic) {
    auto found = std::find_if(calibration.cameras.begin(), calibration.cameras.end(),
                              [&](const auto& c) { return c.camera.id == e.camera; });
    if (found == calibration.cameras.end()) {
      VSS_ASSIGN(Camera camera, ReadCamera(*e.camera_file));
      camera.id = e.camera;
      camera.cam_from_world.reset();
      calibration.cameras.push_back({std::move(camera), std::nullopt, {}, std::nullopt});
      found = calibration.cameras.end() - 1;
    }
    camera_of_job.push_back(static_cast<int>(found - calibration.cameras.begin()));
  }
  std::vector<std::vector<CubePicture>> cubes(job.extrinsic.size());
  std::vector<Status> outcome(job.extrinsic.size());
  std::vector<std::optional<CubeResult>> places(job.extrinsic.size());
  const auto place_all = [&](const Gantry& gantry, bool check_moves) {
    ParallelFor(job.extrinsic.size(), threads, [&](std::size_t i) {
      const ExtrinsicJob& e = job.extrinsic[i];
      auto place = CalibrateFromCube(e.camera, calibration.cameras[camera_of_job[i]].camera.intrinsics,
                                     e.cube, cubes[i], e.camera_near_mm, gantry, check_moves);
      if (place)
        places[i] = std::move(*place);
      else
        outcome[i] = tl::unexpected(place.error());
      progress.Report("cube", static_cast<int>(i) + 1, static_cast<int>(job.extrinsic.size()));
    });
  };
  for (std::size_t i = 0; i < job.extrinsic.size(); ++i) {
    VSS_ASSIGN(cubes[i], ReadCubePictures(job.extrinsic[i], calibration.cameras[camera_of_job[i]].camera));
  }
  place_all(job.gantry, !job.calibrate_axes);
  for (const Status& s : outcome) VSS_RETURN_IF_ERROR(s);
  if (job.calibrate_axes) {
    std::vector<CubeJob> jobs;
    for (std::size_t i = 0; i < job.extrinsic.size(); ++i)
      jobs.push_back({job.extrinsic[i].camera, calibration.cameras[camera_of_job[i]].camera.intrinsics,
                      job.extrinsic[i].cube, &cubes[i], places[i]->cam_from_world});
    VSS_ASSIGN(calibration.axes, CalibrateGantryAxes(jobs));
    calibration.gantry.axes = calibration.axes->axes;
    place_all(calibration.gantry, true);
    for (const Status& s : outcome) VSS_RETURN_IF_ERROR(s);
  }
  if (progress.Cancelled()) return Cancelled();
  for (std::size_t i = 0; i < places.size(); ++i) SetPlace(*places[i], calibration.cameras[camera_of_job[i]]);
  for (auto& c : calibration.cameras) SetAxes(calibration, c);
  for (const auto& c : calibration.cameras)
    if (c.camera.quality)
      calibration.warnings.insert(calibration.warnings.end(), c.camera.quality->warnings.begin(),
                                  c.camera.quality->warnings.end());
  return calibration;
}

void AddCalibration(const Calibration& calibration, OutputFolder& out) {
  for (const auto& c : calibration.cameras)
    out.Add(fs::path("cameras") / (c.camera.id + ".toml"), CameraToToml(c.camera));
  out.Add("calibration.json", CalibrationToJson(calibration));
  out.Add("report.html", CalibrationToHtml(calibration));
}

Status WriteCalibration(const Calibration& calibration, const fs::path& folder) {
  VSS_ASSIGN(OutputFolder out, OutputFolder::Open(folder));
  AddCalibration(calibration, out);
  return out.Commit();
}

}  // namespace vss
