// Camera z [m] of the nearest surface at the pixel's centre.
in float v_z_m;
layout(location = 0) out float out_z_m;
void main() { out_z_m = v_z_m; }
