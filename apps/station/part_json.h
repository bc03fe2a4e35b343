// A part as the station keeps it: product.json's part (vss-product/1), with which line is which contour, the
// covariance, and what the operator said of it.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "vss/identify/placed_object.h"
#include "vss/product/product.h"

namespace vss::station {

using Json = nlohmann::json;

// Lines that the operator drew have numbers from here on; a picture's own lines count from 0.
inline constexpr int kFirstDrawnLine = 1000000;

struct StationPart {
  Part part;
  bool confirmed = false;  // a person looked and said yes
  std::string doubt;       // why a person should look: a sentence; empty where there is no reason
};

Json JsonOf(const Eigen::Vector3d& v);
// Three finite numbers; throws where it is anything else.
Eigen::Vector3d VectorOf(const Json& json);
Json JsonOf(const Eigen::Matrix3d& m);
// A number; NaN where it is null, for JSON has no number that is none.
double NumberOf(const Json& json);
// The number of the picture of that name; throws where there is none.
int ImageIndex(const std::string& file, const std::vector<std::string>& image_files);
Json PartToJson(const StationPart& part, const std::vector<std::string>& image_files);
// A whole number of that name; an error where it is missing, a fraction, or more than an int holds.
Result<int> IntOf(const Json& json, const char* name);
// Errors name the field. Pictures are found by their file names.
Result<StationPart> PartFromJson(const Json& json, const std::vector<std::string>& image_files);

// The object of the knowledge base at the part's place: empty `model` where the knowledge base has no such
// kind.
PlacedObject PlacedObjectOf(const Part& part, const KnowledgeBase& knowledge);

}  // namespace vss::station
