#include "vss/identify/scene.h"
