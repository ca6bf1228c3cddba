// Type `color` of one band (panchromatic) or three (red, green, blue), chosen at compile time.
#if BANDS == 1
#define color float
#define BAND(v) (v).x
#define OUT(c) vec4(c, 0.0, 0.0, 1.0)
#else
#define color vec3
#define BAND(v) (v).xyz
#define OUT(c) vec4(c, 1.0)
#endif
const float PI = 3.14159265358979;
