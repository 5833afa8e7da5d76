// A drum, in mm: a ring of radius 100 to 112 and a back plate that is clamped at its hub.
SetFactory("Built-in");
DefineConstant[ LAYERS = 8 ];
wall[] = {}; hub[] = {}; all[] = {};
Function Patch
  p = newp; c = newl; s = news;
  Point(p) = {r0, 0, z0}; Point(p+1) = {r1, 0, z0}; Point(p+2) = {r1, 0, z1}; Point(p+3) = {r0, 0, z1};
  Line(c) = {p, p+1}; Line(c+1) = {p+1, p+2}; Line(c+2) = {p+2, p+3}; Line(c+3) = {p+3, p};
  Curve Loop(s) = {c, c+1, c+2, c+3}; Plane Surface(s) = {s};
  Transfinite Curve{c, c+2} = 1 + nr; Transfinite Curve{c+1, c+3} = 1 + nz; Transfinite Surface{s}; Recombine Surface{s};
  last = s;
  For k In {0:3}
    out[] = Extrude {{0, 0, 1}, {0, 0, 0}, Pi / 2} { Surface{last}; Layers{LAYERS}; Recombine; };
    last = out[0]; all[] += out[1]; wall[] += out[5]; hub[] += out[5];
    If (part == 0) 
      inner[] += out[5];
    EndIf
    If (part == 2)
      held[] += out[5];
    EndIf
  EndFor
Return
inner[] = {}; held[] = {};
part = 0; r0 = 100; r1 = 112; z0 = -30; z1 = 30; nr = 1; nz = 3; Call Patch;
part = 1; z0 = 30; z1 = 38; nz = 1; Call Patch;
part = 2; r0 = 50; r1 = 100; nr = 3; Call Patch;
Coherence;
Physical Volume("IRON") = {all[]};
Physical Surface("INNER") = {inner[]};
Physical Surface("HUB") = {held[]};
