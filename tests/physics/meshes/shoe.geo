// A shoe of T section with a bonded lining, in mm: 120 degrees about z. HEX = 1: swept hexahedra, 0: tetrahedra.
SetFactory("Built-in");
DefineConstant[ HEX = 1, LAYERS = 12, SIZE = 12 ];
a = -Pi / 3;
Mesh.MeshSizeMax = SIZE; Mesh.MeshSizeMin = SIZE;
Function Patch // a rectangle of the section, r0 to r1 and z0 to z1, swept about z
  p = newp; c = newl; s = news;
  Point(p) = {r0 * Cos(a), r0 * Sin(a), z0}; Point(p+1) = {r1 * Cos(a), r1 * Sin(a), z0};
  Point(p+2) = {r1 * Cos(a), r1 * Sin(a), z1}; Point(p+3) = {r0 * Cos(a), r0 * Sin(a), z1};
  Line(c) = {p, p+1}; Line(c+1) = {p+1, p+2}; Line(c+2) = {p+2, p+3}; Line(c+3) = {p+3, p};
  Curve Loop(s) = {c, c+1, c+2, c+3}; Plane Surface(s) = {s};
  Transfinite Curve{c, c+2} = 1 + nr; Transfinite Curve{c+1, c+3} = 2;
  Transfinite Surface{s};
  If (HEX)
    Recombine Surface{s};
    out[] = Extrude {{0, 0, 1}, {0, 0, 0}, 2 * Pi / 3} { Surface{s}; Layers{LAYERS}; Recombine; };
  Else
    out[] = Extrude {{0, 0, 1}, {0, 0, 0}, 2 * Pi / 3} { Surface{s}; Layers{LAYERS}; };
  EndIf
Return
pad[] = {}; steel[] = {}; top[] = {};
For k In {0:2}
  z0 = (k == 0) ? -15 : ((k == 1) ? -3 : 3); z1 = (k == 0) ? -3 : ((k == 1) ? 3 : 15);
  nr = 1; r0 = 96; r1 = 100; Call Patch;
  pad[] += out[1]; top[] += out[3];
  r0 = 92; r1 = 96; Call Patch;
  steel[] += out[1];
  If (k == 1)
    nr = 2; r0 = 78; r1 = 92; Call Patch;
  steel[] += out[1];
  EndIf
EndFor
Coherence;
Physical Volume("PAD") = {pad[]};
Physical Volume("STEEL") = {steel[]};
Physical Surface("LINING") = {top[]};
