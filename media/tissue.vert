#version 120
// Tissue: what media/tissue.frag lights.

uniform mat4 worldviewproj_matrix;
uniform mat4 worldview_matrix;
uniform mat4 view_matrix;
uniform mat4 world_matrix;

varying vec3 seen_at;  // [m] from the camera
varying vec3 normal;
varying vec3 above;    // where up is, for the camera
varying vec3 at;       // [m] in the world
varying vec3 place;    // [m] of the body at rest
varying vec3 turned;   // its normal there
varying float growth;  // area over area at rest
varying float pressed; // 0 .. 1: how far blood is pressed out of it
varying float from_rim; // [m] to where a cut meets the outer surface

void main()
{
  gl_Position = worldviewproj_matrix * gl_Vertex;
  seen_at = (worldview_matrix * gl_Vertex).xyz;
  normal = (worldview_matrix * vec4(gl_Normal, 0.0)).xyz;
  at = (world_matrix * gl_Vertex).xyz;
  above = (view_matrix * vec4(0.0, 0.0, 1.0, 0.0)).xyz;
  place = gl_MultiTexCoord0.xyz;
  turned = gl_MultiTexCoord2.xyz;
  growth = gl_MultiTexCoord1.x;
  pressed = gl_MultiTexCoord1.y;
  from_rim = gl_MultiTexCoord2.w;
  gl_FrontColor = gl_Color;
}
