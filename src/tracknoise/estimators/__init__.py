"""What an estimator needs: noise models, their fits and exports, and the proof that an estimator gains from them."""
