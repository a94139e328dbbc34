"""The hand: tracking source, velocity, simplex broadcast. It only ever sends."""
