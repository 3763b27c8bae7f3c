//! Adapter to diffsol: implicit and explicit Runge–Kutta and BDF steps.
