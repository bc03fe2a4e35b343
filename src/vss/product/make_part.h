// From identified objects to parts of the product, and from a part back to its solid.
#pragma once
#include <span>
#include <string>

#include "vss/identify/scene.h"
#include "vss/identify/view.h"
#include "vss/product/product.h"
#include "vss/reconstruct/reconstruct.h"

namespace vss {

// How the parts of a product are called, in their order: part-1, part-2, ...
std::string PartId(int index);

// The part as identified; its sigmas are not known (NaN) until it is reconstructed.
Part MakePart(const IdentifiedPart& found, const std::string& id, std::span<const View> views);

// Puts what reconstruction found into `part`: geometry, sigmas, covariance, residuals, and the standard size
// that it tells (designation.h).
void SetReconstruction(const ReconstructedPart& measured, std::span<const View> views, Part& part);

// All parts of the scene, named part-1, part-2, ... in the scene's order, and what stands on what.
Product MakeProduct(const SceneResult& scene, const Reconstruction& reconstruction,
                    std::span<const View> views);

// The part's place and shape as they follow from `object`: pose, dimensions' values, vertices, edges,
// circles.
void SetGeometry(const PlacedObject& object, Part& part);

// The solid of a part (in world, without derivatives), with its faces; empty where the knowledge base has no
// such kind or the dimensions are not that object's.
std::optional<WorldSolid> SolidOfPart(const Part& part, const KnowledgeBase& knowledge);

}  // namespace vss
