// The paper's shoe in a cast-iron cup, in mm, and between them a layer of thickness GAP that stands for the contact.
// The cup is that of drum.geo; the shoe is GAP further in. All share their nodes and are volumes of their own.
SetFactory("Built-in");
DefineConstant[ GAP = 0.002, THROUGH = 4, EDGE = 2, MIDDLE = 6, CORNER = 4, PLATE = 9, SHOE = 4, ARC = 26, REST = 46,
  NARROW = 1.6, NARROW_ALONG = 0.72 ];
R = 100; h = 12; w = 30; p = 8; hub = 50; b = 18.25; beta = 130 * Pi / 180;
a = -beta / 2;
Function Patch // of the section, r0 to r1 and z0 to z1, by mr and mz elements that grow along r and z by gr and gz
  k = newp; c = newl; s = news;
  Point(k) = {r0 * Cos(a), r0 * Sin(a), z0}; Point(k+1) = {r1 * Cos(a), r1 * Sin(a), z0};
  Point(k+2) = {r1 * Cos(a), r1 * Sin(a), z1}; Point(k+3) = {r0 * Cos(a), r0 * Sin(a), z1};
  Line(c) = {k, k+1}; Line(c+1) = {k+1, k+2}; Line(c+2) = {k+3, k+2}; Line(c+3) = {k, k+3};
  Curve Loop(s) = {c, c+1, -(c+2), -(c+3)}; Plane Surface(s) = {s};
  If (bump)
    Transfinite Curve{c, c+2} = 1 + mr Using Bump 0.25;
  Else
    Transfinite Curve{c, c+2} = 1 + mr Using Progression gr;
  EndIf
  Transfinite Curve{c+1, c+3} = 1 + mz Using Progression gz;
  Transfinite Surface{s}; Recombine Surface{s};
  out[] = Extrude {{0, 0, 1}, {0, 0, 0}, beta} { Surface{s}; Layers{ARC}; Recombine; };
  swept[] = {out[1]};
  clamp[] = {out[5]};
  If (whole)
    For q In {0:1}
      out[] = Extrude {{0, 0, 1}, {0, 0, 0}, Pi - beta / 2} { Surface{out[0]}; Layers{REST / 2}; Recombine; };
      swept[] += out[1]; clamp[] += out[5];
    EndFor
  EndIf
Return
whole = 0; bump = 0; gr = 1; gz = 1;
r0 = R - GAP - 20; r1 = R - GAP; z0 = -b; z1 = b; mr = SHOE; mz = MIDDLE;
Call Patch;
shoe[] = {swept[]};
r0 = R - GAP; r1 = R; mr = 1;
Call Patch;
layer[] = {swept[]};
whole = 1; gr = NARROW;
r0 = R; r1 = R + h; mr = THROUGH;
Call Patch;
cup[] = {swept[]};
z0 = -w; z1 = -b; mz = EDGE;
Call Patch;
cup[] += {swept[]};
z0 = b; z1 = w; mz = CORNER; gz = NARROW_ALONG;
Call Patch;
cup[] += {swept[]};
z0 = w; z1 = w + p; mz = THROUGH; gz = NARROW;
Call Patch;
cup[] += {swept[]};
r0 = hub; r1 = R; mr = PLATE; bump = 1;
Call Patch;
cup[] += {swept[]}; held[] = {clamp[]};
Coherence;
Physical Volume("STEEL") = {shoe[]};
Physical Volume("CONTACT") = {layer[]};
Physical Volume("IRON") = {cup[]};
Physical Surface("HUB") = {held[]};
