#include <vector>
void set(unsigned num_scale_levels, unsigned level, float scale_factor_at_level) {
#include "exported/stella_noise.cpp"
}
