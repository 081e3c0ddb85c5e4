// Functions that all 3-D pictures use.

// Draws a ring around a point of a canvas.
const drawRing = (context, x, y) => {
  for (const [colour, width] of [[theme("--stage"), 5], [theme("--chosen"), 2.5]]) {
    context.beginPath();
    context.arc(x, y, 8, 0, 2 * Math.PI);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
};

// The axes X, Y and Z in the lower left corner, in their directions on the screen.
const drawTriad = (context, height, axes) => {
  const [x0, y0, length] = [40, height - 40, 24];
  context.font = `600 12px ${theme("--font")}`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  ["X", "Y", "Z"].forEach((label, k) => {
    const [x, y] = axes[k];
    if (Math.hypot(x, y) < 0.15) return;
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x0 + x * length, y0 + y * length);
    context.strokeStyle = theme("--muted");
    context.lineWidth = 1.5;
    context.stroke();
    context.fillStyle = theme("--text");
    context.fillText(label, x0 + x * (length + 9), y0 + y * (length + 9));
  });
};

