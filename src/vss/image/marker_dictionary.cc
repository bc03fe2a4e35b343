#include "vss/image/marker_dictionary.h"

#include <opencv2/aruco/dictionary.hpp>

namespace vss {

Result<MarkerDictionary> PredefinedMarkers(const std::string& name) {
  int index = -1, n = 0;
  for (const char* side : {"4x4_", "5x5_", "6x6_", "7x7_"})
    for (const char* size : {"50", "100", "250", "1000"}) {
      if (name == std::string(side) + size) index = n;
      ++n;
    }
  if (name == "original") index = n;
  if (index < 0)
    return UsageError(
        "dictionary \"{}\" is not known; known are 4x4_50 to 7x7_1000 (50, 100, 250, 1000) and original",
        name);
  const auto dictionary = cv::aruco::getPredefinedDictionary(index);
  MarkerDictionary markers;
  markers.side = dictionary->markerSize;
  for (int id = 0; id < dictionary->bytesList.rows; ++id) {
    const cv::Mat bits =
        cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.rowRange(id, id + 1), markers.side);
    std::uint64_t code = 0;
    for (int i = 0; i < markers.side * markers.side; ++i)
      if (bits.at<unsigned char>(i / markers.side, i % markers.side)) code |= std::uint64_t{1} << i;
    markers.bits.push_back(code);
  }
  return markers;
}

}  // namespace vss
